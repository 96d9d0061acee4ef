# SPDX-License-Identifier: Apache-2.0
"""A run in progress, observed through the files that its nodes and the sampler write."""

import time
from collections import OrderedDict, deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from slambed.campaign.campaign_state import InHand
from slambed.campaign.growing_file import GrowingFile
from slambed.metrics.events import Event

MEAN_S = 1.0
"""CPU use is the mean over this run time, because single samples show quota periods."""
RECENT_S = 40
"""How much of a run is kept: what fits beside its numbers on a terminal."""


@dataclass(frozen=True)
class NodeUse:
    """Recent resource use of a node."""

    cpu_percent: float
    """Percent of one core."""
    memory_mb: float | None
    """None in virtual time."""
    t_s: float
    """Run time of the last sample; samples are written with a delay of some seconds."""


@dataclass(frozen=True)
class Playing:
    """Progress of a run; None and counts of 0 mean that its files do not show it (yet)."""

    run_key: str
    name: str
    elapsed_s: float
    """Wall-clock time since the attempt began."""
    t_s: float | None = None
    """Run time of the newest log entry; negative while nodes start."""
    frames_offered: int | None = None
    """Number of frames in the playback plan."""
    frames_played: int = 0
    """Frames tracked or dropped."""
    frames_tracked: int = 0
    """Frames with a pose."""
    track_losses: int = 0
    state: str | None = None
    """Tracking state."""
    node_state: str | None = None
    """State of a system that has several states."""
    rtt_ms: float | None = None
    """Last value known to the mobile node."""
    nodes: dict[str, NodeUse] = field(default_factory=dict)
    recent: dict[str, list[float | None]] = field(default_factory=dict)
    """Means over each of the last seconds, None for one without: `rtt_ms`, `track_ms`, and CPU use
    in percent of a core under the names of the nodes."""


class Recent:
    """The last seconds of a quantity: means over each second of run time."""

    def __init__(self) -> None:
        self._sums: OrderedDict[int, tuple[float, int]] = OrderedDict()

    def add(self, t_s: float, value: float) -> None:
        """Adds a measured value."""
        second = int(t_s // 1)
        total, count = self._sums.get(second, (0.0, 0))
        self._sums[second] = (total + value, count + 1)
        while len(self._sums) > RECENT_S:
            self._sums.popitem(last=False)

    def values(self) -> list[float | None]:
        """Returns the means of the last seconds; None for a second without any value."""
        if not self._sums:
            return []
        last = max(self._sums)
        first = max(min(self._sums), last - RECENT_S + 1)
        means = {second: total / count for second, (total, count) in self._sums.items()}
        return [means.get(second) for second in range(first, last + 1)]


class RunFollower:
    """Incrementally reads the files of one run."""

    def __init__(self, run: InHand, folder: Path, frames_offered: int | None) -> None:
        self._run = run
        self._offered = frames_offered
        self._events = GrowingFile(folder / "mobile" / "events.jsonl")
        self._samples = GrowingFile(folder / "samples.jsonl")
        self._last: deque[Event] = deque(maxlen=200)
        self._played = self._tracked = self._losses = 0
        self._t_s: float | None = None
        self._state: str | None = None
        self._node_state: str | None = None
        self._rtt_ms: float | None = None
        self._recent: dict[str, Recent] = {}

    def look(self, now_s: float | None = None) -> Playing:
        """Returns the current progress."""
        for event in self._events.new():
            self._take(event)
        for sample in self._samples.new():
            if isinstance(sample.get("t_s"), int | float):
                self._last.append(sample)
                self._keep(str(sample.get("node")), sample["t_s"], sample.get("cpu_percent"))
                self._keep("rtt_ms", sample["t_s"], sample.get("tcp_rtt_ms"))
                if self._rtt_ms is None or sample.get("tcp_rtt_ms") is not None:
                    self._rtt_ms = _number(sample.get("tcp_rtt_ms"), self._rtt_ms)
        return Playing(
            run_key=self._run.run_key,
            name=self._run.name,
            elapsed_s=(time.time() if now_s is None else now_s) - self._run.since_s,
            t_s=self._run_time_s(),
            frames_offered=self._offered,
            frames_played=self._played,
            frames_tracked=self._tracked,
            track_losses=self._losses,
            state=self._state,
            node_state=self._node_state,
            rtt_ms=self._rtt_ms,
            nodes=_use(self._last),
            recent={name: kept.values() for name, kept in self._recent.items()},
        )

    def _keep(self, name: str, t_s: float | None, value: object) -> None:
        if isinstance(value, int | float) and t_s is not None:
            self._recent.setdefault(name, Recent()).add(t_s, value)

    def _run_time_s(self) -> float | None:
        times_s = [self._t_s, self._last[-1]["t_s"] if self._last else None]
        return max((float(t_s) for t_s in times_s if t_s is not None), default=None)

    def _take(self, event: Event) -> None:
        if isinstance(event.get("t_ns"), int):
            self._t_s = event["t_ns"] / 1e9
        match event.get("type"):
            case "frame_tracked":
                state = str(event.get("state"))
                self._played += 1
                self._tracked += state == "ok"
                self._losses += self._state == "ok" and state != "ok"
                self._state = state
                self._keep("track_ms", self._t_s, event.get("track_ms"))
            case "frame_dropped":
                self._played += 1
            case "state_changed":
                self._node_state = str(event.get("to"))
            case "rtt_sample":
                self._rtt_ms = _number(event.get("rtt_ms"), self._rtt_ms)
                self._keep("rtt_ms", self._t_s, event.get("rtt_ms"))


def _number(value: object, otherwise: float | None) -> float | None:
    return float(value) if isinstance(value, int | float) else otherwise


def _use(samples: deque[Event]) -> dict[str, NodeUse]:
    found: dict[str, NodeUse] = {}
    for node in ("mobile", "edge"):
        own = [s for s in samples if s.get("node") == node and _is_use(s)]
        if not own:
            continue
        last = own[-1]
        recent = [float(s["cpu_percent"]) for s in own if s["t_s"] > last["t_s"] - MEAN_S]
        memory_mb = _number(last.get("memory_mb"), None)
        found[node] = NodeUse(sum(recent) / len(recent), memory_mb, float(last["t_s"]))
    return found


def _is_use(sample: Mapping[str, object]) -> bool:
    return isinstance(sample.get("cpu_percent"), int | float)
