# SPDX-License-Identifier: Apache-2.0
"""Finds the slowest frames, and where their time went: computing, throttled, stalled, queued.

Stages report wall and CPU time of the tracking thread. Wall time above CPU time was lost to its
limits (throttled), to other load on the host (stalled), or to waiting for something else. The
node's counters in the samples tell which. These cover all its threads and are 100 ms apart, so a
part is never more than their growth around the frame.
"""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from slambed.errors import SlambedError
from slambed.explain.run_log import RunLog

Floats = NDArray[np.float64]

TRACKING = ("extract", "track")
"""Stages of the tracking thread only."""
TINY_MS = 1.0
"""Shorter parts are not reported."""
MOST_STAGES = 4
BESIDE = 0.5
"""If the node's other threads worked for this share of the time in which a frame was runnable but
did not run, it waited for them: counters do not tell whom a thread waited for."""
WORDS = {
    "computing": "more to compute",
    "queued": "queued behind earlier frames",
    "throttled": "throttled by its limits",
    "stalled": "stalled by others on the host",
    "shared": "sharing the device's cores with its other threads",
    "waiting": "waiting, not for a processor",
    "unknown": "where the time went is not known: the system reports no stages",
}


@dataclass(frozen=True)
class SlowFrame:
    """One frame from being offered to the end of its tracking."""

    frame: int
    offered_s: float
    """Run time."""
    queued_ms: float
    """From being offered to the start of tracking."""
    wall_ms: float
    """Wall time of its tracking."""
    cpu_ms: float | None
    """CPU time of its tracking; None if no stage was timed."""
    throttled_ms: float = 0.0
    stalled_ms: float = 0.0
    """Runnable within its limits, but not running: other threads had the cores."""
    waiting_ms: float = 0.0
    """Other wall time above CPU time, including time outside of stages."""
    stages: dict[str, float] = field(default_factory=dict)
    """Wall time by stage."""
    concurrent: dict[str, float] = field(default_factory=dict)
    """Wall time of the node's other workers during the frame, by stage."""
    cause: str = "computing"
    """Main reason why it took longer than the usual frame; a key of WORDS."""

    @property
    def total_ms(self) -> float:
        """Returns the time from being offered to the end of tracking."""
        return self.queued_ms + self.wall_ms


def slowest(run: RunLog, count: int) -> list[SlowFrame]:
    """Returns the slowest frames, longest first. Raises SlambedError if the system does not report
    their times."""
    frames = run.of("frame_tracked", node="mobile")
    if frames.empty or "track_ms" not in frames or frames["track_ms"].isna().all():
        raise SlambedError("this system does not report how long its frames took")
    frames = frames.dropna(subset=["track_ms"])
    queued = frames["wait_ms"].fillna(0.0) if "wait_ms" in frames else frames["track_ms"] * 0.0
    frames = frames.assign(queued_ms=queued, total_ms=queued + frames["track_ms"])
    stages = run.of("stage", node="mobile")
    usual_cpu_ms = _usual_cpu_ms(frames, stages)
    longest = frames.sort_values("total_ms", ascending=False, kind="stable").head(count)
    return [
        _explained(run, {str(k): v for k, v in row.items()}, stages, usual_cpu_ms)
        for row in longest.to_dict("records")
    ]


def _usual_cpu_ms(frames: pd.DataFrame, stages: pd.DataFrame) -> float:
    """Returns the median over frames of the CPU time of the TRACKING stages."""
    own = stages[stages["name"].isin(TRACKING)]
    if own.empty or not len(frames):
        return 0.0
    ends = np.sort(frames["t_s"].to_numpy(np.float64))
    which = np.searchsorted(ends, own["t_s"].to_numpy(np.float64) - 1e-9)
    return float(own["cpu_ms"].fillna(0.0).groupby(which).sum().median())


def _explained(
    run: RunLog, row: dict[str, float], stages: pd.DataFrame, usual_cpu_ms: float
) -> SlowFrame:
    end_s, wall_ms = float(row["t_s"]), float(row["track_ms"])
    begin_s = end_s - wall_ms / 1e3
    inside = stages[stages["t_s"].between(begin_s, end_s + 1e-6)]
    workers = set(stages.loc[stages["name"].isin(TRACKING), "worker"])
    own = inside[inside["worker"].isin(workers)]
    with_cpu = own.dropna(subset=["cpu_ms"])
    cpu_ms = float(with_cpu["cpu_ms"].sum()) if len(with_cpu) else None
    above_ms = (
        0.0 if cpu_ms is None else max(0.0, float((with_cpu["wall_ms"] - with_cpu["cpu_ms"]).sum()))
    )
    untimed_ms = max(0.0, wall_ms - float(own["wall_ms"].sum()))
    throttled_ms, stalled_ms = _taken(run, begin_s, end_s, above_ms + untimed_ms)
    if run.status.virtual:
        throttled_ms, stalled_ms = 0.0, above_ms  # the model has no limits; workers share cores
    concurrent = _overlapping(stages, begin_s, end_s, workers)
    shared = run.status.virtual or float(concurrent["wall_ms"].sum()) >= BESIDE * stalled_ms
    queued_ms = float(row["queued_ms"])
    waiting_ms = max(0.0, above_ms + untimed_ms - throttled_ms - stalled_ms)
    if cpu_ms is None:  # it may have computed all the time
        waiting_ms = 0.0
    parts = {
        "unknown": TINY_MS if cpu_ms is None else 0.0,
        "computing": max(0.0, (cpu_ms or 0.0) - usual_cpu_ms),
        "queued": queued_ms,
        "throttled": throttled_ms,
        "shared" if shared else "stalled": stalled_ms,
        "waiting": waiting_ms,
    }
    return SlowFrame(
        frame=0 if pd.isna(number := row.get("frame")) else int(number),
        offered_s=begin_s - queued_ms / 1e3,
        queued_ms=queued_ms,
        wall_ms=wall_ms,
        cpu_ms=cpu_ms,
        throttled_ms=throttled_ms,
        stalled_ms=stalled_ms,
        waiting_ms=waiting_ms,
        stages=_sums(own),
        concurrent=_sums(concurrent),
        cause=max(parts, key=lambda name: parts[name]),
    )


def _sums(stages: pd.DataFrame) -> dict[str, float]:
    found = stages.groupby("name")["wall_ms"].sum().sort_values(ascending=False)
    return {str(name): float(ms) for name, ms in found.head(MOST_STAGES).items() if ms >= TINY_MS}


def _overlapping(
    stages: pd.DataFrame, begin_s: float, end_s: float, workers: set[str]
) -> pd.DataFrame:
    """Returns the stages of other workers in this interval, cut to it."""
    others = stages[~stages["worker"].isin(workers)]
    began_s = others["t_s"] - others["wall_ms"] / 1e3
    common_s = np.minimum(others["t_s"], end_s) - np.maximum(began_s, begin_s)
    return pd.DataFrame(others.assign(wall_ms=1e3 * common_s)[common_s > 0])


def _taken(run: RunLog, begin_s: float, end_s: float, missing_ms: float) -> tuple[float, float]:
    """Returns how much of the missing time was throttled and stalled. Neither exceeds the counters'
    growth from the sample before the frame to the one after it."""
    if not len(run.samples) or missing_ms <= 0:
        return 0.0, 0.0
    own = run.samples[run.samples["node"] == "mobile"].sort_values("t_s")
    t_s = own["t_s"].to_numpy(np.float64)
    if len(t_s) < 2:
        return 0.0, 0.0
    first = max(0, int(np.searchsorted(t_s, begin_s, side="right")) - 1)
    last = min(len(t_s) - 1, int(np.searchsorted(t_s, end_s)))

    def grown_ms(name: str) -> float:
        if name not in own:
            return 0.0
        values = own[name].astype(float).to_numpy(np.float64)
        grown = 1e3 * (values[last] - values[first])
        return float(max(0.0, grown)) if np.isfinite(grown) else 0.0

    throttled = grown_ms("throttled_s")
    # On most kernels, run_delay includes the time of throttled threads.
    stalled = max(0.0, grown_ms("run_delay_s") - throttled)
    if throttled + stalled <= 0:
        return 0.0, 0.0
    share = missing_ms / (throttled + stalled)
    return throttled * min(1.0, share), stalled * min(1.0, share)


def report_lines(run: RunLog, frames: list[SlowFrame]) -> list[str]:
    """Returns a line about all frames, and one per frame."""
    tracked = run.of("frame_tracked", node="mobile")
    usual = float(tracked["track_ms"].median())
    causes = pd.Series([frame.cause for frame in frames]).value_counts()
    most = ", ".join(f"{count} {WORDS[str(cause)]}" for cause, count in causes.items())
    lines = [f"the slowest {len(frames)} of {len(tracked)} frames (median {usual:.1f} ms): {most}"]
    return lines + [line_of(frame, run.status.virtual) for frame in frames]


def line_of(frame: SlowFrame, virtual: bool = False) -> str:
    cpu = "CPU time unknown" if frame.cpu_ms is None else f"{frame.cpu_ms:.1f} ms of it CPU"
    parts = [
        f"frame {frame.frame} at {frame.offered_s:.2f} s: {frame.total_ms:.1f} ms",
        f"tracking {frame.wall_ms:.1f} ms, {cpu}" + _in_words(" (", frame.stages, ")"),
    ]
    taken = "shared cores" if virtual else "stalled"
    for ms, what in (
        (frame.queued_ms, "queued"), (frame.throttled_ms, "throttled"),
        (frame.stalled_ms, taken), (frame.waiting_ms, "waiting"),
    ):  # fmt: skip
        if ms >= TINY_MS:
            parts.append(f"{what} {ms:.1f} ms")
    if frame.concurrent:
        parts.append("beside it" + _in_words(" ", frame.concurrent))
    return "; ".join(parts) + f" -> {WORDS[frame.cause]}"


def _in_words(before: str, stages: dict[str, float], behind: str = "") -> str:
    if not stages:
        return ""
    return before + ", ".join(f"{name} {ms:.1f}" for name, ms in stages.items()) + behind
