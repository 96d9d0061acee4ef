# SPDX-License-Identifier: Apache-2.0
"""Positions of points by ground truth, and the quality of matches over time gaps."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from command_line import refused, slambed
from scipy.spatial.transform import Rotation
from wall_walk import CAMERA, STEP_M, UNIT_M, WALL_M, WIDTH, write_walk

from slambed.data.camera_motion import CameraMotion, epipolar_distance_px, moved_to
from slambed.data.difficulty import compare, features_of, measure
from slambed.data.model import Camera
from slambed.data.prepared import PreparedSequence
from slambed.errors import ExitCode, SlambedError

BENT = CAMERA.model_copy(update={"distortion": (0.1, -0.05, 0.001, 0.002, 0.0)})


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> PreparedSequence:
    return write_walk(tmp_path_factory.mktemp("walks") / "walk")


@pytest.mark.parametrize("camera", [CAMERA, BENT])
def test_points_move_as_the_camera_does(camera: Camera) -> None:
    relative = np.eye(4)
    relative[:3, :3] = Rotation.from_euler("y", 5, degrees=True).as_matrix()
    relative[:3, 3] = [0.1, -0.05, 0.02]
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-0.4, 0.4, (50, 2)), rng.uniform(1.0, 3.0, 50)])
    lens = np.array(camera.distortion)
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    none = np.zeros(3)
    first = cv2.projectPoints(points, none, none, matrix, lens)[0].reshape(-1, 2)
    turn = Rotation.from_matrix(relative[:3, :3]).as_rotvec()
    second = cv2.projectPoints(points, turn, relative[:3, 3], matrix, lens)[0].reshape(-1, 2)
    seen, depths_m = moved_to(camera, relative, first, points[:, 2])
    assert np.allclose(seen, second, atol=0.01)
    assert np.allclose(depths_m, (points @ relative[:3, :3].T + relative[:3, 3])[:, 2], atol=1e-4)
    assert np.all(epipolar_distance_px(camera, relative, first, second) < 0.01)
    shifted = epipolar_distance_px(camera, relative, first, second + np.array([0, 7]))
    assert np.median(shifted) > 3


def test_ground_truth_is_interpolated_and_has_ends(tmp_path: Path) -> None:
    sequence = write_walk(tmp_path / "walk", frames=5)
    rows = np.loadtxt(sequence.groundtruth_file)
    np.savetxt(sequence.groundtruth_file, rows[[0, 2, 3]])
    motion = CameraMotion.of(sequence)
    assert [motion.knows(k) for k in range(5)] == [True, True, True, True, False]
    assert np.allclose(motion.between(0, 1)[:3, 3], [-STEP_M, 0, 0])


def test_of_one_wall_everything_in_view_is_right(walk: PreparedSequence) -> None:
    measured = measure(walk, (0.1, 0.5, 2.0))
    assert measured.judge == "depth"
    assert (measured.depth_share, round(measured.median_depth_m, 6)) == (1.0, WALL_M)
    assert [round(gap.flow_px) for gap in measured.gaps] == [3, 15, 60]
    near, _, far = measured.gaps
    assert near.precision > 0.99 and far.precision > 0.95
    assert near.right_per_visible > 0.5
    assert near.inliers > 0.9 * near.matches
    assert near.matches > far.matches


def test_of_strange_pictures_nothing_is(tmp_path: Path) -> None:
    measured = measure(write_walk(tmp_path / "strange", strange=True), (0.5,))
    assert measured.gaps[0].right_per_visible < 0.05


def test_a_hidden_point_is_not_asked_for(walk: PreparedSequence) -> None:
    motion = CameraMotion.of(walk)
    first, second = (0, features_of(walk, 0)), (1, features_of(walk, 1))
    visible = compare(walk, motion, first, second).visible
    # An object at 1 m covers the left half of the second image.
    plane = np.array(walk.second(1))
    plane[:, : WIDTH // 2] = round(1.0 / UNIT_M)

    class Hidden(PreparedSequence):
        def second(self, i: int):
            return plane if i == 1 else super().second(i)

    hidden = Hidden(walk.path, walk.info, walk.index)
    fewer = compare(hidden, motion, first, second).visible
    assert 0.3 * visible < fewer < 0.7 * visible


def test_without_depth_the_epipolar_line_judges(tmp_path: Path) -> None:
    measured = measure(write_walk(tmp_path / "one_eye", sensor="mono"), (0.5,))
    assert measured.judge == "epipolar line"
    assert measured.depth_share == 0
    assert measured.gaps[0].precision > 0.95


def test_without_ground_truth_nothing_is_known(tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match="has no ground truth"):
        measure(write_walk(tmp_path / "blind", frames=3, truth=False))


def test_the_command_puts_sequences_beside_each_other(
    walk: PreparedSequence, tmp_path: Path
) -> None:
    other = write_walk(tmp_path / "other", frames=12)
    figure, table = tmp_path / "f.png", tmp_path / "t.csv"
    code, out, err = slambed(
        "data",
        "difficulty",
        str(walk.path),
        str(other.path),
        "-o",
        str(figure),
        "--table",
        str(table),
    )
    assert code == ExitCode.OK, err
    assert "walk: " in out and "right by depth" in out
    assert figure.read_bytes().startswith(b"\x89PNG")
    rows = table.read_text().splitlines()
    assert rows[0].startswith("id,judge,features,depth_share,median_depth_m,gap_s,pairs,matches")
    assert {row.split(",")[0] for row in rows[1:]} == {"walk", "other"}
    line = refused(ExitCode.BAD_INPUT, "data", "difficulty", str(walk.path), "-o", "x.gif")
    assert "unknown picture format" in line


def test_where_nothing_can_be_written_nothing_is_measured(
    walk: PreparedSequence, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slambed.data.difficulty.measure", lambda _: pytest.fail("measured"))
    difficulty = ("data", "difficulty", str(walk.path))
    assert "unknown picture format" in refused(ExitCode.BAD_INPUT, *difficulty, "-o", "x.gif")
    nowhere, good = str(tmp_path / "nowhere" / "x"), str(tmp_path / "x.png")
    line = refused(ExitCode.BAD_INPUT, *difficulty, "-o", f"{nowhere}.png")
    assert "No such file or directory; choose another --output" in line
    line = refused(ExitCode.BAD_INPUT, *difficulty, "-o", good, "--table", f"{nowhere}.csv")
    assert "No such file or directory; choose another --table" in line
    assert not list(tmp_path.iterdir())
