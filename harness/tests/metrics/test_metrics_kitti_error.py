# SPDX-License-Identifier: Apache-2.0
"""Relative errors per path length as in KITTI's benchmark."""

from pathlib import Path

import numpy as np
import pytest
from results_factory import RawRun, spec_of, write_raw
from scipy.spatial.transform import Rotation

from slambed.data.trajectory import EMPTY, Trajectory
from slambed.metrics.kitti_error import kitti_error
from slambed.metrics.run_summary import summarize_run


def drive(meters: int, scale: float = 1.0, deg_per_m: float = 0.0) -> Trajectory:
    """A straight path with one pose per meter; an estimate that turns drives an arc."""
    x_m = np.arange(meters + 1.0)
    turns = Rotation.from_rotvec(np.column_stack([0 * x_m, 0 * x_m, np.radians(deg_per_m) * x_m]))
    step = turns.apply(np.tile([scale, 0.0, 0.0], (len(x_m), 1)))
    positions = np.vstack([np.zeros(3), np.cumsum(step[:-1], axis=0)])
    return Trajectory(x_m / 10, positions, turns.as_quat())


def test_a_path_that_is_too_long_by_a_share_is_off_by_that_share() -> None:
    found = kitti_error(drive(1000, scale=1.02), drive(1000))
    assert found is not None
    # A segment ends at the first pose beyond its length: 101 m for 100 m.
    assert found.translation_percent == pytest.approx(2.0, rel=0.02)
    assert found.rotation_deg_per_m == pytest.approx(0.0, abs=1e-9)
    assert not found.short


def test_an_estimate_that_turns_is_off_by_its_angle_per_meter() -> None:
    found = kitti_error(drive(300, deg_per_m=0.01), drive(300))
    assert found is not None
    assert found.rotation_deg_per_m == pytest.approx(0.01, rel=0.02)
    # Over 100 m it turns by one degree; its direction is off by half of that.
    assert found.translation_percent == pytest.approx(100 * np.radians(0.5) * 5 / 3, rel=0.2)


def test_a_short_path_has_short_parts_and_says_so() -> None:
    found = kitti_error(drive(99, scale=1.1), drive(99))
    assert found is not None
    assert found.short
    assert found.translation_percent == pytest.approx(10.0, rel=0.1)
    # A segment ends beyond its length, as in the benchmark: a path of 10 m has no segment of 10 m.
    assert kitti_error(drive(10), drive(10)) is None
    assert kitti_error(drive(11), drive(11)) is not None
    assert kitti_error(EMPTY, drive(99)) is None


def test_who_loses_the_camera_early_has_no_shorter_parts() -> None:
    own = drive(300)
    assert kitti_error(own.take(np.arange(90)), drive(300)) is None
    some = kitti_error(own.take(np.arange(150)), drive(300))
    assert some is not None
    assert not some.short


def test_where_the_true_path_begins_and_looks_changes_nothing() -> None:
    turn = Rotation.from_rotvec([0.3, -0.2, 1.0])
    own = drive(200, scale=1.02, deg_per_m=0.02)
    moved = Trajectory(
        own.stamps_s, turn.apply(own.positions_m) + 5.0, (turn * own.rotations()).as_quat()
    )
    first, second = kitti_error(own, drive(200)), kitti_error(moved, drive(200))
    assert first is not None
    assert second is not None
    assert second.translation_percent == pytest.approx(first.translation_percent)
    assert second.rotation_deg_per_m == pytest.approx(first.rotation_deg_per_m)


@pytest.mark.parametrize(("seconds", "short"), [(30.0, True), (220.0, False)])
def test_numbers_of_short_paths_have_keys_of_their_own(
    seconds: float, short: bool, tmp_path: Path
) -> None:
    raw = write_raw(tmp_path / "raw", RawRun(duration_s=seconds))
    found = summarize_run(raw, spec_of("edgeslam", "static", "ramp_85", 0))
    for asked in ("rte_percent", "rre_deg_per_m"):
        assert (found[asked] is None) == short
        other = asked.replace("_", "_short_", 1)
        assert (found[other] is None) != short
