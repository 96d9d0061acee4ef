# SPDX-License-Identifier: Apache-2.0
"""Tracking quality: losses, relocalizations, step times."""

from dataclasses import dataclass

import numpy as np

from slambed.metrics.events import Event, EventLog

SEEING_SHARE = 0.5
"""A frame with this share of the usual number of features is sufficient for relocalization."""


@dataclass(frozen=True)
class Tracking:
    """Counts over one run; times are sequence time in seconds. None: not measured."""

    frames_total: int
    frames_tracked: int
    frames_dropped: int
    track_losses: int
    loss_times_s: tuple[float, ...]
    relocalizations: int
    resets: int
    lost_s: float
    """Sequence time between each loss and the next pose, or the end of the run."""
    reloc_s_max: float | None
    """Longest time from the first frame with enough features, while lost, to the next pose."""

    @property
    def first_loss_s(self) -> float | None:
        """Sequence time of the first loss."""
        return self.loss_times_s[0] if self.loss_times_s else None


def tracking_of(log: EventLog) -> Tracking:
    """Counts transitions of the frame states; without frame events it uses `track_lost` events
    (a system with its own program may write only those)."""
    frames = log.of("frame_tracked")
    dropped = log.of("frame_dropped")
    losses: list[float] = []
    lost_s = 0.0
    lost_since: float | None = None
    previous = ""
    last = 0.0
    for frame in frames:
        state, last = str(frame.get("state")), float(frame.get("seq_s", last))
        # A young map is reset at once, so the first frame after the loss is already
        # not_initialized.
        if previous == "ok" and state != "ok":
            losses.append(last)
        if state == "lost" and lost_since is None:
            lost_since = last
        if state == "ok" and lost_since is not None:
            lost_s += last - lost_since
            lost_since = None
        previous = state
    if lost_since is not None:
        lost_s += last - lost_since
    if not frames:
        losses = [float(e.get("seq_s", 0.0)) for e in log.of("track_lost")]
    relocations = relocalization_times_s(frames)
    tracked = sum(frame.get("state") == "ok" for frame in frames)
    return Tracking(
        frames_total=len(frames) + len(dropped),
        frames_tracked=tracked,
        frames_dropped=len(dropped),
        track_losses=len(losses),
        loss_times_s=tuple(losses),
        relocalizations=len(log.of("relocalized")),
        resets=len(log.of("reset")),
        lost_s=lost_s,
        reloc_s_max=max(relocations, default=None),
    )


def relocalization_times_s(frames: list[Event]) -> list[float]:
    """Returns for each loss the time from the first frame with enough features to the next pose.

    Enough is half of the median of tracked frames. A loss that lasts to the end counts up to the
    last frame; a loss that ends with a new map does not count.
    """
    usual = [float(f["features"]) for f in frames if f.get("state") == "ok" and f.get("features")]
    enough = SEEING_SHARE * float(np.median(usual)) if usual else 0.0
    times: list[float] = []
    lost = False
    seeing_since: float | None = None
    last = 0.0
    for frame in frames:
        state, last = frame.get("state"), float(frame.get("seq_s", last))
        if state == "lost":
            lost = True
            if seeing_since is None and float(frame.get("features", enough)) >= enough:
                seeing_since = last
            continue
        if state == "ok" and lost:
            times.append(last - seeing_since if seeing_since is not None else 0.0)
        lost, seeing_since = False, None
    if seeing_since is not None:
        times.append(last - seeing_since)
    return times


def values_of(events: list[Event], key: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Returns the numbers under this key, skipping events without it."""
    numbers = [e[key] for e in events if isinstance(e.get(key), int | float)]
    return np.array(numbers, dtype=np.float64)


def mean_of(events: list[Event], key: str) -> float | None:
    """Returns the mean; None if nothing was measured."""
    values = values_of(events, key)
    return float(values.mean()) if len(values) else None


def quantile_of(events: list[Event], key: str, share: float) -> float | None:
    """Returns the quantile; None if nothing was measured."""
    values = values_of(events, key)
    return float(np.quantile(values, share)) if len(values) else None
