# SPDX-License-Identifier: Apache-2.0
"""The error of the pose in force: a late pose is compared with the current camera position."""

from typing import Any

import numpy as np
import pytest

from slambed.data.trajectory import Trajectory
from slambed.metrics.accuracy import Alignment
from slambed.metrics.events import EventLog
from slambed.metrics.in_force import error_in_force_m_mean

FPS = 10
ORIGIN_S = 1000.0
STILL = Alignment(np.eye(3), np.zeros(3))


def path(frames: list[int]) -> Trajectory:
    """The camera moves 1 m per frame."""
    x_m, zero = np.array(frames, dtype=np.float64), np.zeros(len(frames))
    return Trajectory(
        ORIGIN_S + x_m / FPS,
        np.column_stack([x_m, zero, zero]),
        np.column_stack([zero, zero, zero, zero + 1]),
    )


def event(kind: str, frame: int, at_s: float, **more: Any) -> dict[str, Any]:
    node = more.pop("node", "mobile")
    return {"type": kind, "node": node, "t_ns": round(at_s * 1e9), "frame": frame} | more


def log_of(events: list[dict[str, Any]]) -> EventLog:
    return EventLog(sorted(events, key=lambda expected: expected["t_ns"]))


def tracked(frame: int, delay_s: float, state: str = "ok") -> dict[str, Any]:
    half = delay_s * 500
    return event(
        "frame_tracked",
        frame,
        frame / FPS + delay_s,
        seq_s=frame / FPS,
        state=state,
        track_ms=half,
        wait_ms=half,
    )


def offloaded(frame: int, delay_s: float) -> list[dict[str, Any]]:
    """A frame tracked on the edge, whose pose the mobile node gets with the answer."""
    time_s = frame / FPS
    on_edge = event(
        "frame_tracked",
        frame,
        time_s + delay_s / 2,
        node="edge",
        seq_s=time_s,
        state="ok",
        track_ms=1.0,
        wait_ms=0.0,
    )
    answer = event("frame_answered", frame, time_s + delay_s, ok=True, latency_ms=1e3 * delay_s)
    return [event("frame_sent", frame, time_s, seq_s=time_s), on_edge, answer]


@pytest.mark.parametrize(("delay_s", "frames_late"), [(0.05, 1), (0.11, 2), (0.25, 3), (0.95, 10)])
def test_a_pose_is_as_wrong_as_it_is_late(delay_s: float, frames_late: int) -> None:
    frames = list(range(30))
    onboard = log_of([tracked(frame, delay_s) for frame in frames])
    edge = log_of([expected for frame in frames for expected in offloaded(frame, delay_s)])
    for log in (onboard, edge):
        found = error_in_force_m_mean(log, path(frames), path(frames), STILL)
        assert found == pytest.approx(frames_late)


def test_dropped_and_lost_frames_are_judged_by_the_pose_there_is() -> None:
    dropped = [event("frame_dropped", 1, 0.2, seq_s=0.1), event("frame_dropped", 3, 0.4, seq_s=0.3)]
    log = log_of([tracked(0, 0.05), tracked(2, 0.05), tracked(4, 0.05, "lost"), *dropped])
    # Frame 0 has no pose yet; at 1 and 2 the pose of 0 is in force, at 3 and 4 that of 2.
    found = error_in_force_m_mean(log, path([0, 2]), path(list(range(5))), STILL)
    assert found == pytest.approx((1 + 2 + 1 + 2) / 4)


def test_alignment_is_that_of_the_whole_path() -> None:
    log = log_of([tracked(frame, 0.05) for frame in range(5)])
    halved = path(list(range(5))).scaled(0.5)
    twice = Alignment(np.eye(3), np.zeros(3), scale=2.0)
    assert error_in_force_m_mean(log, halved, path(list(range(5))), twice) == pytest.approx(1.0)


def test_a_reset_takes_the_poses_before_it_away() -> None:
    log = log_of([tracked(frame, 0.25) for frame in range(10)])
    # Poses of frames 6 to 9 remain: the first is known at 0.85 s, so only frame 9 is judged.
    found = error_in_force_m_mean(log, path([6, 7, 8, 9]), path(list(range(10))), STILL)
    assert found == pytest.approx(3.0)


def test_where_playback_waits_frames_have_the_time_at_which_they_came() -> None:
    events = []
    for frame in range(5):  # one second each, although recorded at 10 Hz
        reported = tracked(frame, 0.8)
        events.append(reported | {"t_ns": round((frame + 0.8) * 1e9)})
    found = error_in_force_m_mean(log_of(events), path(list(range(5))), path(list(range(5))), STILL)
    assert found == pytest.approx(1.0)


def test_nothing_is_made_up_where_nothing_is_reported() -> None:
    frames = path([0, 1, 2])
    assert error_in_force_m_mean(log_of([]), frames, frames, STILL) is None
    too_few = log_of([tracked(0, 0.05)])
    assert error_in_force_m_mean(too_few, frames, frames, STILL) is None
    nameless = log_of([{"type": "frame_tracked", "node": "mobile", "t_ns": 1, "state": "ok"}])
    assert error_in_force_m_mean(nameless, path([0]), path([0]), STILL) is None
