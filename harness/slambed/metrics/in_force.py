# SPDX-License-Identifier: Apache-2.0
"""Error of the pose known to the mobile node when a frame arrives: a late pose is compared with
the current position of the camera (INFOCOM 2020, Figure 5)."""

import numpy as np
from numpy.typing import NDArray

from slambed.data.association import MAX_DIFFERENCE_S, match_nearest
from slambed.data.trajectory import Trajectory
from slambed.metrics.accuracy import Alignment
from slambed.metrics.events import Event, EventLog

Floats = NDArray[np.float64]


def error_in_force_m_mean(
    log: EventLog, live: Trajectory, truth: Trajectory, alignment: Alignment
) -> float | None:
    """Returns the mean distance between the newest pose known at each frame's time and the true
    pose at that time.

    Frames before the first pose of the path do not count. Frames without tracking do, with the last
    pose before the loss. None if no event reports when poses became known.
    """
    placed = _placed(log)[-len(live) :]
    seq_s = _sequence_times_s(log)
    # A reset clears both the path and the poses, so the last events belong to the path.
    if not len(live) or len(placed) < len(live) or placed[-1]["frame"] not in seq_s:
        return None
    known_s = np.array([event["t_ns"] for event in placed]) / 1e9
    offered_s = _offered_s(log, seq_s)
    frames = sorted(offered_s)
    newest = np.searchsorted(known_s, [offered_s[frame] for frame in frames], side="right") - 1
    origin_s = live.stamps_s[-1] - seq_s[placed[-1]["frame"]]
    stamps_s = origin_s + np.array([seq_s[frame] for frame in frames])
    judged, true = match_nearest(stamps_s, truth.stamps_s, MAX_DIFFERENCE_S)
    had_one = newest[judged] >= 0
    if not had_one.any():
        return None
    estimate = alignment.apply(live.positions_m[newest[judged[had_one]]])
    distances = np.linalg.norm(estimate - truth.positions_m[true[had_one]], axis=1)
    return float(distances.mean())


def _reports(log: EventLog) -> list[Event]:
    """Returns the events that report poses to the mobile node: answers if there are any, else
    its tracking."""
    return log.of("frame_answered", node="mobile") or log.of("frame_tracked", node="mobile")


def _placed(log: EventLog) -> list[Event]:
    return [e for e in _reports(log) if (e.get("ok") or e.get("state") == "ok") and "frame" in e]


def _sequence_times_s(log: EventLog) -> dict[int, float]:
    """Returns the sequence time of each offered frame; answers contain only the frame number."""
    frame_events = log.of("frame_tracked", "frame_dropped", "frame_sent")
    whole = (event for event in frame_events if "frame" in event and "seq_s" in event)
    return {event["frame"]: float(event["seq_s"]) for event in whole}


def _offered_s(log: EventLog, seq_s: dict[int, float]) -> dict[int, float]:
    """Returns the run time of each frame. In real time it equals the sequence time. If playback
    waits for tracking, frames come later and none is dropped."""
    found = dict(seq_s)
    for event in log.of("frame_sent", node="mobile"):
        if event.get("frame") in found:
            found[event["frame"]] = event["t_ns"] / 1e9
    for event in _reports(log):
        if event.get("frame") in found:
            found[event["frame"]] = event["t_ns"] / 1e9 - _spent_s(event)
    return found


def _spent_s(event: Event) -> float:
    """Returns the time from a frame's arrival to this event."""
    latency = event.get("latency_ms")
    if latency is None:
        latency = event.get("track_ms", 0.0) + event.get("wait_ms", 0.0)
    return float(latency) / 1e3
