# SPDX-License-Identifier: Apache-2.0
"""Finds the compute times behind a report's numbers: those of a device's cost model, or of this
host.

Live runs under limits take the host's compute times, so one device name may mean two machines; the
ratio tells how far apart they are. Live runs at the device's pace take the model's times in real
time.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import fsum

import numpy as np

from slambed.errors import SlambedError
from slambed.metrics.events import Event
from slambed.report.kept_events import with_events
from slambed.report.load import Results
from slambed.spec.device import VIRTUAL, CostModel
from slambed.spec.experiment import DEVICE_PACE
from slambed.spec.library import Library

STAGES = ("extract", "track")
"""Stages of the mobile node for every frame."""
KINDS = ("stage", "frame_tracked")
CLOSE = 1.25
"""Times within this factor are called the same machine."""
FAR = 2.0
"""Live times off by more than this factor cause a warning, because other frames are dropped and
other tracks lost than on the device."""
MOST_NAMED = 3
"""Systems whose times are printed one by one."""


@dataclass(frozen=True)
class ComputeTime:
    """Time of extraction and tracking per frame on the mobile node, in milliseconds."""

    device: str
    virtual: bool
    paced: bool
    """Live, at the device's pace."""
    ran_ms: float
    board: bool
    """On a real board, not on this host."""
    model_ms: float | None
    """What the device's cost model charges for the same work; None without one."""
    known: Mapping[str, float] = field(default_factory=dict[str, float])
    """Times of the systems on it that report stages; `ran_ms` is their median."""
    unknown: tuple[str, ...] = ()
    """Systems on it that report no stages, such as a user's own."""

    @property
    def ratio(self) -> float | None:
        """Returns how many times as long the device would take."""
        return None if self.model_ms is None else self.model_ms / self.ran_ms

    def warning(self, name: str) -> str | None:
        """Returns how far live runs are from their device, and what to do. `name` is the
        experiment. None if the times are close or unknown."""
        if self.virtual or self.paced or self.board or self.model_ms is None or self.ratio is None:
            return None
        if 1 / FAR <= self.ratio <= FAR:
            return None
        fast = self.ratio > 1
        factor = self.ratio if fast else 1 / self.ratio
        measured = (
            f"live runs on {self.device} are {factor:.1f} times as {'fast' if fast else 'slow'} as "
            f"the device: extraction and tracking took {self.ran_ms:.1f} ms per frame (measured), "
            f"its cost model says {self.model_ms:.1f} ms"
        )
        if not fast:
            return (
                f"{measured}. This host is too slow for it, or too busy: take another one, or "
                "--engine virtual"
            )
        measured += (
            ". Frames dropped, tracks lost and CPU use are those of this host, not of the device"
        )
        if self.unknown:
            return (
                f"{measured}. {', '.join(self.unknown)}: no stages are reported, so 'pace: device' "
                "cannot hold it up; work that a CPU limit slows down counts more for a slow system"
            )
        return (
            f"{measured}. Write 'pace: device' into the experiment, or give --set pace=device to "
            f"'slambed run {name}': every stage then takes what the model charges"
        )

    def line(self) -> str:
        """Returns the compute times in a sentence."""
        per_frame = f"extraction and tracking take {self._times()} per frame"
        if self.virtual:
            return f"Compute times of {self.device} are those of its cost model: {per_frame}."
        if self.paced:
            return (
                f"Compute times of {self.device} are those of its cost model, kept in real time: "
                f"{per_frame}."
            )
        if self.board:
            return f"Compute times of {self.device} are the board's own: {per_frame}."
        if self.model_ms is None or self.ratio is None:
            return f"Compute times of {self.device} are those of this host: {per_frame}."
        if 1 / CLOSE <= self.ratio <= CLOSE:
            return (
                f"Compute times of {self.device}: {per_frame}, {self.ratio:.2f} of which its cost "
                "model charges."
            )
        return (
            f"Compute times of {self.device} are those of this host under its limits: {per_frame}, "
            f"where its cost model charges {self.model_ms:.1f} ms, {self.ratio:.1f} times as long. "
            "Live and virtual runs of this device are runs of two machines."
        )

    def _times(self) -> str:
        """Returns `3.1 ms (orbslam2) and 4.7 ms (edgeslam: static)`, of many systems the range."""
        if 0 < len(self.known) <= MOST_NAMED:
            return " and ".join(f"{ms:.1f} ms ({label})" for label, ms in self.known.items())
        if not self.known:
            return f"{self.ran_ms:.1f} ms"
        low, high = min(self.known.values()), max(self.known.values())
        return f"{low:.1f} to {high:.1f} ms ({len(self.known)} systems, median {self.ran_ms:.1f})"


def compute_times(results: Results) -> list[ComputeTime]:
    """Returns one entry per mobile device, kind of engine and pace, from one run of each system on
    it."""
    found: list[ComputeTime] = []
    runs = results.valid_runs
    kinds = [
        runs["device_mobile"],
        runs["engine"].eq(VIRTUAL),
        runs["pace"].eq(DEVICE_PACE),
        runs["board"].notna(),
    ]
    for (device, virtual, paced, board), rows in runs.groupby(kinds, sort=False):
        model = _model(str(device))
        ran: dict[str, float] = {}
        charged: list[float] = []
        unknown: list[str] = []
        for label, own in rows.groupby("label", sort=False):
            kept = next(iter(with_events(results, own, KINDS)["run_key"]), "")
            log = results.events(str(kept), KINDS)
            frames = len(log.of("frame_tracked")) if log is not None else 0
            if log is None or not frames:
                continue
            stages = [e for e in log.of("stage", node="mobile") if e.get("name") in STAGES]
            if not stages:
                unknown.append(str(label))
                continue
            ran[str(label)] = fsum(float(e.get("wall_ms") or 0.0) for e in stages) / frames
            if model is not None:
                charged.append(fsum(_charged_ms(model, e) for e in stages) / frames)
        if ran and (ran_ms := float(np.median([*ran.values()]))) > 0:
            model_ms = (float(np.median(charged)) or None) if charged else None
            kind = (bool(virtual), bool(paced), ran_ms, bool(board))
            found.append(ComputeTime(str(device), *kind, model_ms, ran, tuple(unknown)))
    return found


def _model(device: str) -> CostModel | None:
    """Returns the model of a device file; None for a device defined in an experiment."""
    try:
        return Library().device(device).model
    except SlambedError:
        return None


def _charged_ms(model: CostModel, event: Event) -> float:
    cost = model.stages.get(str(event.get("name")))
    if cost is None:
        return 0.0
    n1, n2 = float(event.get("n1") or 0.0), float(event.get("n2") or 0.0)
    return (cost.a_us + cost.b_us * n1 + cost.c_us * n2) / model.speed / 1e3
