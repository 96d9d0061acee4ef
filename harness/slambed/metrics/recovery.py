# SPDX-License-Identifier: Apache-2.0
"""The cost of map updates and losses in frames and time (IJNC 15(2), 2025, Sec. 4): frames
processed, frames dropped while an update blocked tracking, and how long relocalization takes
after the camera returned to a known place."""

import numpy as np
from numpy.typing import NDArray

from slambed.data.association import MAX_DIFFERENCE_S, match_nearest
from slambed.data.trajectory import Trajectory
from slambed.metrics.events import Event, EventLog
from slambed.metrics.tracking import mean_of

KNOWN_DISTANCE_M = 0.4
KNOWN_ANGLE_DEG = 20.0
"""A camera this close to a pose that was tracked before sees mapped points."""


def pause_ms_mean(log: EventLog, relocalization: bool) -> float | None:
    """Returns the mean time for which tracking was blocked, for maps sent for relocalization or
    for other updates."""
    updates = log.of("update_applied")
    return mean_of(
        [e for e in updates if bool(e.get("relocalization")) == relocalization], "pause_ms"
    )


def frames_lost_to_updates(log: EventLog) -> int | None:
    """Returns the number of frames dropped while a map update blocked tracking; None if not
    reported."""
    held = [e for e in log.of("update_applied") if isinstance(e.get("pause_ms"), int | float)]
    if not held and log.of("update_applied"):
        return None
    dropped = np.array([event["t_ns"] for event in log.of("frame_dropped")], dtype=np.float64)
    lost = np.zeros(len(dropped), dtype=bool)
    for event in held:
        lost |= (dropped >= event["t_ns"] - event["pause_ms"] * 1e6) & (dropped <= event["t_ns"])
    return int(lost.sum())


def sequence_times_s(live: Trajectory, log: EventLog) -> NDArray[np.float64] | None:
    """Returns the sequence times of live poses: the last pose belongs to the last tracked frame."""
    tracked = [event for event in log.of("frame_tracked") if event.get("state") == "ok"]
    if not tracked or not len(live):
        return None
    times_s: NDArray[np.float64] = live.stamps_s - live.stamps_s[-1] + float(tracked[-1]["seq_s"])
    return times_s


def known_place_times_s(log: EventLog, live: Trajectory, truth: Trajectory) -> list[float]:
    """Returns for each loss from which the camera returned: the time from the first lost frame near
    a previously tracked pose to the next pose, or to the last frame.

    The camera must have been elsewhere in between, because it is near the last tracked pose when
    the loss occurs. If it never moves away, the time counts from the first lost frame.
    """
    times_s = sequence_times_s(live, log)
    frames = log.of("frame_tracked")
    if times_s is None or not len(truth):
        return []
    offset_s = float(live.stamps_s[-1] - times_s[-1])
    stamps = np.array([float(frame["seq_s"]) for frame in frames]) + offset_s
    own, other = match_nearest(stamps, truth.stamps_s, MAX_DIFFERENCE_S)
    true_pose = np.full(len(frames), -1)
    true_pose[own] = other
    return [
        found
        for begin, end in _losses(frames)
        if (found := _known(frames, true_pose, truth, begin, end)) is not None
    ]


def _losses(frames: list[Event]) -> list[tuple[int, int]]:
    """Returns for each loss the first lost frame and the next one with a pose (or the number of
    frames)."""
    found: list[tuple[int, int]] = []
    begin: int | None = None
    for i, frame in enumerate(frames):
        if frame.get("state") == "lost" and begin is None:
            begin = i
        elif frame.get("state") != "lost" and begin is not None:
            found.append((begin, i))
            begin = None
    return found if begin is None else [*found, (begin, len(frames))]


def _known(
    frames: list[Event], true_pose: NDArray[np.intp], truth: Trajectory, begin: int, end: int
) -> float | None:
    seen = [i for i in range(begin) if frames[i].get("state") == "ok" and true_pose[i] >= 0]
    lost = [i for i in range(begin, end) if true_pose[i] >= 0]
    if not seen or not lost:
        return None
    near = [_near(truth, true_pose[i], true_pose[seen]) for i in lost]
    away = next((k for k, is_near in enumerate(near) if not is_near), None)
    back = 0 if away is None else next((k for k in range(away, len(near)) if near[k]), None)
    if back is None:
        return None
    until = frames[min(end, len(frames) - 1)]
    return float(until["seq_s"]) - float(frames[lost[back]]["seq_s"])


def _near(truth: Trajectory, pose: int, others: NDArray[np.intp]) -> bool:
    steps = np.linalg.norm(truth.positions_m[others] - truth.positions_m[pose], axis=1)
    close = others[steps <= KNOWN_DISTANCE_M]
    if not len(close):
        return False
    turns = truth.rotations()[close] * truth.rotations()[int(pose)].inv()
    return bool(np.any(turns.magnitude() <= np.radians(KNOWN_ANGLE_DEG)))
