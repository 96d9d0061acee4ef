# SPDX-License-Identifier: Apache-2.0
"""Why tracking was lost: each loss of a run with the preceding events and a cause."""

from dataclasses import dataclass
from enum import StrEnum

from slambed.metrics.events import Event, EventLog

EVENTS = ("frame_tracked", "frame_dropped", "update_applied", "relocalized")
"""Event types that explain a loss."""

STANDSTILL_FRAMES = 2
"""With this many missing frames the motion model, which counts frames instead of time, predicts
a wrong pose."""
STANDSTILL_REACH = 3
"""Checks the lost frame and the two tracked before it: a rescued frame leaves a wrong velocity
behind."""
BEHIND_UPDATE_S = 0.5
JUST_FOUND_S = 1.0
"""For one second after a relocalization ORB-SLAM2 requires 50 inliers instead of 30."""
MOTION_MATCHES, REFERENCE_MATCHES, INLIERS, INLIERS_FOUND = 20, 15, 30, 50
"""Thresholds of ORB-SLAM2's tracking."""
USUAL_FEATURES = 0.5
"""A frame with a smaller share of the usual number of features has little texture."""


class Cause(StrEnum):
    """Causes of a loss; the first matching one applies."""

    JUST_FOUND = "lost again"
    STANDSTILL = "standstill"
    GAP = "gap behind an update"
    VIEW = "view change"


@dataclass(frozen=True)
class TrackLoss:
    """The frame at which track was lost; None: not reported by the events."""

    seq_s: float
    t_s: float
    frame: int | None
    last_frame: int | None
    """The last frame with a pose."""
    cause: Cause
    missing_frames: int
    """Maximum number of missing frames before this frame or one of the two frames tracked before
    it."""
    update_s: float | None
    """Time since the last map update was applied."""
    update_pause_ms: float | None
    """How long that update blocked tracking."""
    gap_keyframes: int | None
    """Keyframes that the update removed from the local map."""
    found_s: float | None
    """Time since the last relocalization."""
    inliers: int | None
    motion_matches: int | None
    word_matches: int | None
    reference_matches: int | None
    features_share: float | None
    """Number of features relative to the median frame."""


def losses_of(log: EventLog) -> list[TrackLoss]:
    """Returns all losses of a run in order; there are none before the first pose."""
    frames = log.of("frame_tracked")
    dropped = [int(event["t_ns"]) for event in log.of("frame_dropped")]
    losses: list[TrackLoss] = []
    for place, frame in enumerate(frames):
        if place and frames[place - 1].get("state") == "ok" and frame.get("state") != "ok":
            losses.append(_loss(log, frames, place, dropped))
    return losses


def _loss(log: EventLog, frames: list[Event], place: int, dropped: list[int]) -> TrackLoss:
    frame = frames[place]
    t_ns = int(frame["t_ns"])
    update = _last(log.of("update_applied"), t_ns)
    found = _last(log.of("relocalized"), t_ns)
    missing = max(
        _missing(frames, at, dropped)
        for at in range(max(1, place - STANDSTILL_REACH + 1), place + 1)
    )
    update_s = None if update is None else (t_ns - int(update["t_ns"])) / 1e9
    found_s = None if found is None else (t_ns - int(found["t_ns"])) / 1e9
    gap = None if update is None else update.get("gap_keyframes")
    features = sorted(int(f["features"]) for f in frames if f.get("features") is not None)
    usual = features[len(features) // 2] if features else 0
    return TrackLoss(
        seq_s=float(frame.get("seq_s", t_ns / 1e9)),
        t_s=t_ns / 1e9,
        frame=frame.get("frame"),
        last_frame=frames[place - 1].get("frame"),
        cause=_cause(missing, update_s, gap, found_s),
        missing_frames=missing,
        update_s=update_s,
        update_pause_ms=None if update is None else update.get("pause_ms"),
        gap_keyframes=gap,
        found_s=found_s,
        inliers=frame.get("inliers"),
        motion_matches=frame.get("motion_matches"),
        word_matches=frame.get("word_matches"),
        reference_matches=frame.get("reference_matches"),
        features_share=frame["features"] / usual if usual and "features" in frame else None,
    )


def _cause(missing: int, update_s: float | None, gap: int | None, found_s: float | None) -> Cause:
    if found_s is not None and found_s < JUST_FOUND_S:
        return Cause.JUST_FOUND
    if missing >= STANDSTILL_FRAMES:
        return Cause.STANDSTILL
    if update_s is not None and update_s <= BEHIND_UPDATE_S and (gap or 0) > 0:
        return Cause.GAP
    return Cause.VIEW


def _last(events: list[Event], until_ns: int) -> Event | None:
    earlier = [event for event in events if int(event["t_ns"]) <= until_ns]
    return earlier[-1] if earlier else None


def _missing(frames: list[Event], place: int, dropped: list[int]) -> int:
    """Returns the number of frames between this frame and the previous tracked one; older runs
    report only the drops."""
    if (reported := frames[place].get("missing_frames")) is not None:
        return int(reported)
    begin, end = int(frames[place - 1]["t_ns"]), int(frames[place]["t_ns"])
    return sum(begin < t_ns <= end for t_ns in dropped)


def sentence(loss: TrackLoss) -> str:
    """Explains the loss in one sentence."""
    return f"{_reason(loss)}; {_search(loss)}" if _search(loss) else _reason(loss)


def _reason(loss: TrackLoss) -> str:
    update = _update(loss)
    if loss.cause is Cause.JUST_FOUND:
        return (
            f"lost again {loss.found_s:.2f} s after it had been found, while {INLIERS_FOUND} "
            f"inliers are asked for{f' and {loss.inliers} agree' if loss.inliers else ''}"
        )
    if loss.cause is Cause.STANDSTILL:
        behind = f", {update}" if update else ""
        return f"tracking stood still and {loss.missing_frames} frames are missing{behind}"
    if loss.cause is Cause.GAP:
        return f"{update} and took {loss.gap_keyframes} of the newest keyframes away"
    share = loss.features_share
    if share is not None and share < USUAL_FEATURES:
        return f"the picture shows little ({share:.0%} of the usual features)"
    return "the view changed by more than the map shows" + (f" ({update})" if update else "")


def _update(loss: TrackLoss) -> str:
    if loss.update_s is None or loss.update_s > BEHIND_UPDATE_S:
        return ""
    held = (
        f" after holding tracking for {loss.update_pause_ms:.0f} ms" if loss.update_pause_ms else ""
    )
    return f"a map update came {loss.update_s:.2f} s before{held}"


def _search(loss: TrackLoss) -> str:
    """Describes how far the pose search got."""
    ways = []
    if loss.motion_matches is not None:
        ways.append(
            f"the motion model found {loss.motion_matches} points ({MOTION_MATCHES} wanted)"
        )
    if loss.word_matches is not None:
        ways.append(
            f"words matched {loss.word_matches} of the reference keyframe "
            f"({REFERENCE_MATCHES} wanted)"
        )
    if loss.reference_matches is not None and loss.reference_matches != loss.word_matches:
        ways.append(f"descriptors alone {loss.reference_matches}")
    if loss.inliers:
        wanted = INLIERS_FOUND if loss.cause is Cause.JUST_FOUND else INLIERS
        ways.append(f"the local map agreed with {loss.inliers} ({wanted} wanted)")
    return ", ".join(ways)
