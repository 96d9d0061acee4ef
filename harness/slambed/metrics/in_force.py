# SPDX-License-Identifier: Apache-2.0
"""Error of the pose that the mobile had when a frame came: a late one is judged by where the camera
is by then, not by where it was (INFOCOM 2020, Figure 5)."""

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
    """Mean distance of the newest pose known at each frame's time to the truth of that time.

    Frames before the first pose of the path count nowhere, those while lost do: the pose before the
    loss is what there is. None where no event reports when poses were known.
    """
    placed = _placed(log)[-len(live) :]
    seq_s = _sequence_times_s(log)
    # A reset clears path and poses alike, so the last events are those of the path.
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
    """What reports when the mobile had a pose: answers where frames have them, else its
    tracking."""
    return log.of("frame_answered", node="mobile") or log.of("frame_tracked", node="mobile")


def _placed(log: EventLog) -> list[Event]:
    return [e for e in _reports(log) if (e.get("ok") or e.get("state") == "ok") and "frame" in e]


def _sequence_times_s(log: EventLog) -> dict[int, float]:
    """By frame, of all that playback offered; answers name the frame alone."""
    frame_events = log.of("frame_tracked", "frame_dropped", "frame_sent")
    whole = (event for event in frame_events if "frame" in event and "seq_s" in event)
    return {event["frame"]: float(event["seq_s"]) for event in whole}


def _offered_s(log: EventLog, seq_s: dict[int, float]) -> dict[int, float]:
    """Run time of every frame. In real time that is its sequence time; where playback waits for
    tracking, frames come later than that, and none is dropped."""
    found = dict(seq_s)
    for event in log.of("frame_sent", node="mobile"):
        if event.get("frame") in found:
            found[event["frame"]] = event["t_ns"] / 1e9
    for event in _reports(log):
        if event.get("frame") in found:
            found[event["frame"]] = event["t_ns"] / 1e9 - _spent_s(event)
    return found


def _spent_s(event: Event) -> float:
    """From a frame's time until this event."""
    latency = event.get("latency_ms")
    if latency is None:
        latency = event.get("track_ms", 0.0) + event.get("wait_ms", 0.0)
    return float(latency) / 1e3
