# SPDX-License-Identifier: Apache-2.0
"""ATE, RPE and association compared with evo and with known values."""

import copy
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from path_files import write_path
from results_factory import noisy, room_walk
from scipy.spatial.transform import Rotation

from slambed.data.association import match_nearest, match_tum
from slambed.data.trajectory import Trajectory, read_groundtruth, read_tum, write_tum
from slambed.errors import SlambedError
from slambed.metrics.accuracy import (
    absolute_error,
    align_umeyama,
    pairs_by_time,
    product,
    relative_error,
)


def evo_pair(truth: Path, estimate: Path, max_difference_s: float = 0.02):
    sync = pytest.importorskip("evo.core.sync")
    files = pytest.importorskip("evo.tools.file_interface")
    pair = files.read_tum_trajectory_file(str(truth)), files.read_tum_trajectory_file(str(estimate))
    return sync.associate_trajectories(*pair, max_diff=max_difference_s)


def evo_ate(reference, estimate, with_scale: bool = False) -> float:
    metrics = pytest.importorskip("evo.core.metrics")
    moved = copy.deepcopy(estimate)
    moved.align(reference, correct_scale=with_scale)
    metric = metrics.APE(metrics.PoseRelation.translation_part)
    metric.process_data((reference, moved))
    return float(metric.get_statistic(metrics.StatisticsType.rmse))


def evo_rpe(reference, estimate, delta: int, all_pairs: bool) -> tuple[float, float]:
    metrics = pytest.importorskip("evo.core.metrics")
    found = []
    for relation in (
        metrics.PoseRelation.translation_part,
        metrics.PoseRelation.rotation_angle_deg,
    ):
        metric = metrics.RPE(relation, delta=delta, all_pairs=all_pairs)
        metric.process_data((reference, estimate))
        found.append(float(metric.get_statistic(metrics.StatisticsType.rmse)))
    return found[0], found[1]


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """A true path at 100 Hz and an estimate at 30 Hz with shifted timestamps and gaps."""
    rng = np.random.default_rng(5)
    truth = room_walk(20.0)
    estimate = noisy(room_walk(20.0, 30.0), 0.02, rng)
    keep = np.flatnonzero(rng.random(len(estimate)) > 0.2)
    estimate = estimate.take(keep)
    stamps = estimate.stamps_s + rng.uniform(-0.004, 0.004, len(keep))
    estimate = Trajectory(stamps, estimate.positions_m, estimate.quaternions_xyzw)
    write_path(tmp_path / "truth.txt", truth)
    write_path(tmp_path / "estimate.txt", estimate)
    return tmp_path / "truth.txt", tmp_path / "estimate.txt"


@pytest.mark.parametrize("with_scale", [False, True])
def test_ate_equals_evo(files: tuple[Path, Path], with_scale: bool) -> None:
    truth, estimate = files
    ours = absolute_error(read_tum(estimate), read_tum(truth), with_scale=with_scale)
    reference, moved = evo_pair(truth, estimate)
    assert ours.pairs == reference.num_poses
    assert ours.rmse == pytest.approx(evo_ate(reference, moved, with_scale), abs=1e-9)
    assert ours.alignment == ("Sim3" if with_scale else "SE3")


@pytest.mark.parametrize(("delta", "all_pairs"), [(1, True), (1, False), (10, True), (10, False)])
def test_rpe_equals_evo(files: tuple[Path, Path], delta: int, all_pairs: bool) -> None:
    truth, estimate = files
    ours = relative_error(
        read_tum(estimate), read_tum(truth), None, delta_frames=delta, all_pairs=all_pairs
    )
    trans_m, rot_deg = evo_rpe(*evo_pair(truth, estimate), delta, all_pairs)
    assert ours.translation_m.rmse == pytest.approx(trans_m, abs=1e-9)
    assert ours.rotation_deg.rmse == pytest.approx(rot_deg, abs=1e-6)


@pytest.fixture
def evo_files(recording: Callable[[str], Path]) -> Path:
    """The trajectories of evo's own tests."""
    return recording("evo_files")


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("truth", "estimate"),
    [
        ("fr2_desk_groundtruth.txt", "fr2_desk_ORB.txt"),
        ("freiburg1_xyz-groundtruth.txt", "freiburg1_xyz-rgbdslam.txt"),
    ],
)
@pytest.mark.parametrize("max_difference_s", [0.01, 0.02])
def test_real_files_equal_evo(
    evo_files: Path, truth: str, estimate: str, max_difference_s: float
) -> None:
    true, own = read_tum(evo_files / truth), read_tum(evo_files / estimate)
    pair = evo_pair(evo_files / truth, evo_files / estimate, max_difference_s)
    ate = absolute_error(own, true, max_difference_s)
    rpe = relative_error(own, true, None, 10, max_difference_s)
    trans_m, rot_deg = evo_rpe(*pair, 10, True)
    assert ate.rmse == pytest.approx(evo_ate(*pair), abs=1e-6)
    assert rpe.translation_m.rmse == pytest.approx(trans_m, abs=1e-6)
    assert rpe.rotation_deg.rmse == pytest.approx(rot_deg, abs=1e-6)


@pytest.mark.recordings
def test_fr2_desk_as_published(evo_files: Path) -> None:
    """The figures that the TUM script and evo print for ORB-SLAM2's fr2_desk trajectory."""
    true = read_tum(evo_files / "fr2_desk_groundtruth.txt")
    own = read_tum(evo_files / "fr2_desk_ORB.txt")
    tum = absolute_error(own, true, method="tum")
    assert (tum.pairs, round(tum.rmse, 6)) == (2223, 0.008144)
    assert round(absolute_error(own, true, 0.01).rmse, 6) == 0.008119


def test_tum_association_is_one_to_one_and_greedy() -> None:
    truth = np.array([0.000, 0.010, 0.030])
    estimate = np.array([0.008, 0.011, 0.029])
    first, second = match_tum(truth, estimate, 0.02)
    # The pairs 0.010-0.011 and 0.030-0.029 (1 ms each) are taken first; 0.008 remains for 0.000.
    assert list(zip(first, second, strict=True)) == [(0, 0), (1, 1), (2, 2)]
    queries, stamps = match_nearest(truth, estimate, 0.02)
    assert list(zip(queries, stamps, strict=True)) == [(0, 0), (1, 1), (2, 2)]
    # Two estimates compete for one true pose: the greedy rule gives it to the closer one only.
    assert len(match_tum(np.array([0.0]), np.array([-0.004, 0.003]), 0.02)[0]) == 1
    assert len(match_nearest(np.array([-0.004, 0.003]), np.array([0.0]), 0.02)[0]) == 2


def test_tum_association_against_brute_force() -> None:
    rng = np.random.default_rng(3)
    a, b = np.sort(rng.uniform(0, 2, 150)), np.sort(rng.uniform(0, 2, 90))
    candidates = sorted(
        (abs(x - y), i, j) for i, x in enumerate(a) for j, y in enumerate(b) if abs(x - y) < 0.02
    )
    taken: list[tuple[int, int]] = []
    for _, i, j in candidates:
        if all(i != p and j != q for p, q in taken):
            taken.append((i, j))
    first, second = match_tum(a, b, 0.02)
    assert sorted(taken) == list(zip(first.tolist(), second.tolist(), strict=True))


def test_alignment_recovers_a_known_motion_and_refuses_reflection() -> None:
    rng = np.random.default_rng(2)
    points = rng.normal(size=(50, 3))
    turn = Rotation.random(random_state=rng).as_matrix()
    moved = 1.7 * points @ turn.T + [1.0, 2.0, 3.0]
    found = align_umeyama(points, moved, with_scale=True)
    assert found.scale == pytest.approx(1.7)
    np.testing.assert_allclose(found.rotation, turn, atol=1e-12)
    np.testing.assert_allclose(found.apply(points), moved, atol=1e-12)
    mirrored = align_umeyama(points, points * [1, 1, -1])
    assert np.linalg.det(mirrored.rotation) == pytest.approx(1.0)


def test_scale_is_never_free_unless_asked(files: tuple[Path, Path]) -> None:
    truth = read_tum(files[0])
    shrunk = Trajectory(truth.stamps_s, 0.5 * truth.positions_m, truth.quaternions_xyzw)
    assert absolute_error(shrunk, truth).rmse > 0.5
    assert absolute_error(shrunk, truth, with_scale=True).rmse == pytest.approx(0.0, abs=1e-9)


def test_rpe_over_a_second_of_known_drift() -> None:
    """The pose drifts away from the truth by 1 cm per second along its own x axis."""
    stamps = np.arange(0.0, 10.0, 0.05)
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(stamps), 1))
    truth = Trajectory(stamps, np.outer(stamps, [0.3, 0.0, 0.0]), still)
    creeping = Trajectory(stamps, np.outer(stamps, [0.31, 0.0, 0.0]), still)
    error = relative_error(creeping, truth, 1.0)
    assert error.translation_m.rmse == pytest.approx(0.01)
    assert error.rotation_deg.rmse == pytest.approx(0.0, abs=1e-9)
    assert error.translation_m.pairs == len(stamps) - 20


def test_pairs_by_time_skip_gaps() -> None:
    stamps = np.array([0.0, 0.5, 1.0, 1.5, 2.6])
    assert pairs_by_time(stamps, 1.0).tolist() == [[0, 2], [1, 3]]


def test_too_few_poses_are_refused() -> None:
    short = room_walk(0.02)
    with pytest.raises(SlambedError, match="at least 3"):
        absolute_error(short, short)
    with pytest.raises(SlambedError, match="1 s apart"):
        relative_error(short, short)


def test_files_round_trip(tmp_path: Path) -> None:
    walk = room_walk(2.0)
    write_path(tmp_path / "t.txt", walk)
    again = read_tum(tmp_path / "t.txt")
    np.testing.assert_allclose(again.positions_m, walk.positions_m, atol=1e-8)
    write_tum(tmp_path / "ours.txt", walk)
    ours = read_tum(tmp_path / "ours.txt")
    np.testing.assert_allclose(ours.positions_m, walk.positions_m, atol=5e-7)
    assert np.abs((ours.rotations() * walk.rotations().inv()).magnitude()).max() < 5e-9
    matrices = np.tile(np.eye(4), (len(walk), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = walk.rotations().as_matrix(), walk.positions_m
    again = Trajectory.of_matrices(walk.stamps_s, matrices)
    assert absolute_error(again, walk).rmse < 1e-12
    assert np.abs((again.rotations() * walk.rotations().inv()).magnitude()).max() < 1e-12


def test_ground_truth_strictly_increases_and_has_unit_quaternions(tmp_path: Path) -> None:
    """TUM's files contain some repeated times; an estimate keeps its duplicates."""
    (tmp_path / "t.txt").write_text("2 5 0 0 0 0 0 2\n1 0 0 0 0 0 0 1\n2 9 0 0 0 0 0 1\n")
    assert read_tum(tmp_path / "t.txt").stamps_s.tolist() == [1, 2, 2]
    truth = read_groundtruth(tmp_path / "t.txt")
    assert truth.rows().tolist() == [[1, 0, 0, 0, 0, 0, 0, 1], [2, 5, 0, 0, 0, 0, 0, 1]]
    (tmp_path / "t.txt").write_text("# nothing\n")
    assert len(read_tum(tmp_path / "t.txt")) == 0
    with pytest.raises(SlambedError, match="no pose in it"):
        read_groundtruth(tmp_path / "t.txt")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("1 2 3\n", r"t\.txt:1"),
        ("1 0 0 0 0 0 0 1\n2 0 0 nan 0 0 0 1\n", r"t\.txt:2"),
        ("1 0 0 0 0 0 0 0\n", "quaternion"),
    ],
)
def test_bad_trajectories_are_refused(tmp_path: Path, text: str, complaint: str) -> None:
    (tmp_path / "t.txt").write_text(text)
    with pytest.raises(SlambedError, match=complaint):
        read_tum(tmp_path / "t.txt")


def test_rpe_finds_partners_where_a_second_is_no_whole_number_of_frames() -> None:
    """KITTI's frames are 103.7 ms apart: none lies within 20 ms of one second later."""
    truth = room_walk(20.0, 30.0)
    indices = np.round(np.arange(0, 19.9, 0.1037) * 30).astype(int)
    stamps_s = truth.stamps_s[0] + 0.1037 * np.arange(len(indices))
    path = Trajectory(stamps_s, truth.positions_m[indices], truth.quaternions_xyzw[indices])
    drift = relative_error(path, path, 1.0)
    assert drift.translation_m.pairs == len(path) - 10
    assert drift.translation_m.rmse == pytest.approx(0, abs=1e-9)


def test_the_product_of_rotations_is_that_of_scipy() -> None:
    rng = np.random.default_rng(4)
    first, second = Rotation.random(500, rng), Rotation.random(500, rng)
    turn = (product(first, second) * (first * second).inv()).magnitude()
    assert turn.max() < 1e-15


def test_a_trajectory_is_read_alike_at_once_and_line_by_line(tmp_path: Path) -> None:
    """Commas force the slow parser; both parsers must return the same numbers."""
    lines = ["# time x y z", "1.5 0.1 -2e-3 3 0 0 0 1", "", "2.5 1 2 3 0 0.6 0 0.8 # turned"]
    plain, other = tmp_path / "plain.txt", tmp_path / "other.txt"
    plain.write_text("\n".join(lines))
    other.write_text("\n".join(lines).replace("1.5 0.1", "1.5, 0.1"))
    found, expected = read_tum(plain), read_tum(other)
    assert len(found) == 2
    for name in ("stamps_s", "positions_m", "quaternions_xyzw"):
        assert np.array_equal(getattr(found, name), getattr(expected, name))


@pytest.mark.parametrize(
    ("later_s", "complaint"),
    [
        (1000.0, "they do not overlap; use one clock and seconds"),
        (0.025, "the nearest two poses are 25 ms apart; raise the limit"),
    ],
)
def test_too_few_pairs_say_what_keeps_them_apart(later_s: float, complaint: str) -> None:
    walk = Trajectory.of_rows(np.array([[t, t, 0, 0, 0, 0, 0, 1.0] for t in range(5)]))
    other = Trajectory(walk.stamps_s + later_s, walk.positions_m, walk.quaternions_xyzw)
    with pytest.raises(SlambedError, match=rf"0 pose pairs within 20 ms.*{complaint}"):
        absolute_error(walk, other)


def test_a_path_of_two_poses_is_called_too_short() -> None:
    rows = [[t, t, 0, 0, 0, 0, 0, 1.0] for t in range(5)]
    path, short = (Trajectory.of_rows(np.array(some)) for some in (rows, rows[:2]))
    with pytest.raises(SlambedError, match=r"the estimate has too few poses \(2\)"):
        absolute_error(short, path)
    with pytest.raises(SlambedError, match=r"the ground truth has too few poses \(2\)"):
        absolute_error(path, short)


def test_a_short_path_explains_how_to_be_compared() -> None:
    rows = [[t / 10, t, 0, 0, 0, 0, 0, 1.0] for t in range(5)]
    walk = Trajectory.of_rows(np.array(rows))
    with pytest.raises(SlambedError, match=r"which last 0.4 s; take a shorter interval .--delta-s"):
        relative_error(walk, walk, 1.0)
    assert relative_error(walk, walk, 0.2).translation_m.pairs == 3
