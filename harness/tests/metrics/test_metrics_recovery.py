# SPDX-License-Identifier: Apache-2.0
"""Cost of losses and updates: relocalization at known places, frames lost to updates, shares of
work."""

from typing import Any

import numpy as np
import pandas as pd
import pytest

from slambed.data.trajectory import Trajectory
from slambed.metrics.events import EventLog
from slambed.metrics.recovery import frames_lost_to_updates, known_place_times_s, pause_ms_mean
from slambed.metrics.resources import resources_of
from slambed.metrics.work_shares import UPDATE, WORK, share_of_update, share_of_work

FPS = 10
ORIGIN_S = 1000.0
"""Time origin of the timestamps; sequence time counts from the first played frame."""


def log_of(events: list[dict[str, Any]]) -> EventLog:
    return EventLog([{"node": "mobile", "t_ns": 0} | event for event in events])


def walk(states: str) -> EventLog:
    """One letter per frame: o(k), l(ost)."""
    names = {"o": "ok", "l": "lost"}
    return log_of(
        [
            {"type": "frame_tracked", "t_ns": i * 10**8, "seq_s": i / FPS, "state": names[letter]}
            for i, letter in enumerate(states)
        ]
    )


def truth_of(x_m: list[float], yaw_deg: list[float] | None = None) -> Trajectory:
    half = np.radians(yaw_deg or [0.0] * len(x_m)) / 2
    zero = np.zeros(len(x_m))
    return Trajectory(
        ORIGIN_S + np.arange(len(x_m)) / FPS,
        np.column_stack([x_m, zero, zero]),
        np.column_stack([zero, np.sin(half), zero, np.cos(half)]),
    )


def live_of(truth: Trajectory, states: str) -> Trajectory:
    return truth.take(np.array([i for i, letter in enumerate(states) if letter == "o"]))


@pytest.mark.parametrize(
    ("states", "x_m", "expected"),
    [
        # Away at frame 4, back at frame 7 near frame 1, relocalized at frame 9.
        ("ooollllllo", [0, 1, 2, 2, 3, 4, 3, 1.1, 1.1, 1.1], [0.2]),
        # Back and never relocalized: counts up to the last frame.
        ("ooolllllll", [0, 1, 2, 2, 3, 4, 3, 1.1, 1.1, 1.1], [0.2]),
        # Never back.
        ("ooolllllll", [0, 1, 2, 2, 3, 4, 5, 6, 7, 8], []),
        # It stays where it was lost: counts from the first lost frame.
        ("ooollllooo", [0, 1, 2, 2, 2, 2, 2, 2, 2, 2], [0.4]),
        # Relocalized while away; a second loss counts separately.
        ("oollolllol", [0, 1, 5, 5, 5, 9, 5, 5, 5, 5], [0.2, 0.0]),
    ],
)
def test_a_camera_waits_from_its_return_to_a_known_place(
    states: str, x_m: list[float], expected: list[float]
) -> None:
    truth = truth_of(x_m)
    found = known_place_times_s(walk(states), live_of(truth, states), truth)
    assert found == pytest.approx(expected)


def test_a_place_seen_from_another_side_is_not_known() -> None:
    states, x_m = "oollllll", [0.0, 1, 5, 5, 1, 1, 1, 1]
    looks_back = truth_of(x_m, [0, 0, 0, 0, 90, 90, 15, 15])
    waits = known_place_times_s(walk(states), live_of(looks_back, states), looks_back)
    assert waits == pytest.approx([0.1])


def test_frames_dropped_while_an_update_held_tracking_up_are_lost_to_it() -> None:
    log = log_of(
        [
            {"type": "frame_dropped", "t_ns": int(t_ms * 1e6)}
            for t_ms in (90.0, 150.0, 190.0, 300.0, 990.0)
        ]
        + [
            {"type": "update_applied", "t_ns": int(200e6), "pause_ms": 100.0},
            {
                "type": "update_applied",
                "t_ns": int(1000e6),
                "pause_ms": 20.0,
                "relocalization": True,
            },
        ]
    )
    assert frames_lost_to_updates(log) == 3
    assert (pause_ms_mean(log, False), pause_ms_mean(log, True)) == (100.0, 20.0)
    assert frames_lost_to_updates(log_of([{"type": "update_applied"}])) is None


def test_shares_of_work_and_of_updates_add_up() -> None:
    spent = {
        "extract": 30.0, "track": 30.0, "relocalize": 10.0, "create_keyframe": 5.0,
        "serialize": 5.0, "parse": 2.0, "insert_keyframes": 14.0, "update_reference": 1.0,
        "update_last_frame": 1.0, "clean_map": 2.0, "another": 50.0,
    }  # fmt: skip
    events = [{"type": "stage", "name": name, "wall_ms": ms} for name, ms in spent.items()]
    log = log_of([*events, {"type": "stage", "node": "edge", "name": "parse", "wall_ms": 99.0}])
    assert {part: share_of_work(log, part) for part in WORK} == pytest.approx(
        {"extract": 0.3, "pose": 0.4, "keyframe": 0.1, "update": 0.2}
    )
    assert {part: share_of_update(log, part) for part in UPDATE} == pytest.approx(
        {"clean": 0.1, "insert": 0.8, "reference": 0.05, "last_frame": 0.05}
    )
    assert share_of_update(log_of(events[:4]), "clean") is None
    assert share_of_work(log_of([]), "pose") is None


def test_memory_grows_by_the_line_through_the_samples() -> None:
    samples = pd.DataFrame(
        {"node": "mobile", "t_s": [0.0, 30.0, 60.0, 90.0], "memory_mb": [100, np.nan, 112, 118]}
    )
    assert resources_of(samples, "mobile", None).memory_mb_per_min == pytest.approx(12.0)
    assert resources_of(samples[:1], "mobile", None).memory_mb_per_min is None
