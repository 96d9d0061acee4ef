# SPDX-License-Identifier: Apache-2.0
"""Error of a live path relative to the reference named by its dataset: unaligned, over scored
frames."""

import json
from pathlib import Path

import numpy as np
import pytest
from path_files import write_path
from results_factory import RawRun, spec_of, write_raw

from slambed.data.trajectory import EMPTY, Trajectory, read_tum
from slambed.metrics.events import EventLog
from slambed.metrics.reference_path import reference_errors, scored_part
from slambed.metrics.run_data import REFERENCE_FILE
from slambed.metrics.run_summary import summarize_run


def path_of(frames: int) -> Trajectory:
    turn = np.linspace(0, 3, frames)
    positions = np.column_stack([5 * np.cos(turn), 5 * np.sin(turn), 0 * turn])
    return Trajectory(
        100 + 0.1 * np.arange(frames), positions, np.tile([0, 0, 0, 1.0], (frames, 1))
    )


def log_of(*events: tuple[float, str, dict[str, object]]) -> EventLog:
    return EventLog(
        [
            {"node": "mobile", "t_ns": int(t * 1e9), "type": kind, "seq_s": t} | more
            for t, kind, more in events
        ]
    )


TRACKED = (0.2, "frame_tracked", {"state": "ok"})
ALIGN = (0.0, "state_changed", {"from": "start", "to": "ALIGN"})


def test_drift_counts_and_an_alignment_takes_it() -> None:
    reference = path_of(30)
    moved = Trajectory(
        reference.stamps_s, reference.positions_m + np.array([3, 4, 0]), reference.quaternions_xyzw
    )
    found = reference_errors(moved, reference)
    assert found.rmse_m == pytest.approx(5.0)
    assert found.aligned_m == pytest.approx(0.0, abs=1e-9)
    assert found.pairs == 30
    assert reference_errors(EMPTY, reference).rmse_m is None


def test_frames_before_the_alignment_and_after_a_reset_are_not_scored() -> None:
    live = path_of(20)  # the first pose belongs to the frame at 0.2 s
    log = log_of(
        ALIGN, TRACKED, (0.7, "trip_aligned", {}), (1.2, "reset", {}), (1.6, "trip_aligned", {})
    )
    scored = scored_part(live, log)
    times = np.round(scored.stamps_s - 100 + 0.2, 6)
    assert list(times) == [0.7, 0.8, 0.9, 1.0, 1.1, 1.6, 1.7, 1.8, 1.9, 2.0, 2.1]


def test_the_first_poses_of_a_trip_count_only_once_it_is_placed() -> None:
    """As in systems/cloudslam: the initial state of a run is not logged."""
    reported = (0.3, "state_changed", {"from": "ALIGN", "to": "TRIP"})
    log = log_of(TRACKED, reported, (0.3, "trip_aligned", {}))
    assert len(scored_part(path_of(20), log)) == 19
    assert len(scored_part(path_of(20), log_of(TRACKED, (9.0, "align_failed", {})))) == 0


def test_a_trip_that_was_never_aligned_has_no_error_and_others_need_no_alignment() -> None:
    assert len(scored_part(path_of(20), log_of(ALIGN, TRACKED))) == 0
    assert len(scored_part(path_of(20), log_of(TRACKED))) == 20


def test_a_summary_has_the_error_where_the_run_has_a_reference(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun(duration_s=3.0))
    spec = spec_of("orbslam2", "default", None, 0)
    assert summarize_run(raw, spec)["reference_rmse_m"] is None
    live = read_tum(raw / "mobile" / "trajectory_live.txt")
    shifted = Trajectory(
        live.stamps_s, live.positions_m + np.array([0, 0, 2]), live.quaternions_xyzw
    )
    write_path(raw / REFERENCE_FILE, shifted)
    summary = summarize_run(raw, spec)
    assert summary["reference_rmse_m"] == pytest.approx(2.0, abs=1e-5)
    assert summary["reference_rmse_aligned_m"] == pytest.approx(0.0, abs=1e-5)
    json.dumps(summary, allow_nan=False)
