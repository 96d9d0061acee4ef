# SPDX-License-Identifier: Apache-2.0
"""On which compute times the numbers of a report stand: a device's cost model, or this host's own.

A device of one name is two machines where live runs take what a limited host takes: the ratio says
how far apart they are.
"""

from dataclasses import dataclass

import numpy as np

from slambed.errors import SlambedError
from slambed.metrics.events import Event
from slambed.report.load import Results
from slambed.spec.device import VIRTUAL, CostModel
from slambed.spec.library import Library

STAGES = ("extract", "track")
"""What the mobile node does for every frame."""
CLOSE = 1.25
"""Times within this factor are called the same machine."""


@dataclass(frozen=True)
class ComputeTime:
    """Time of extraction and tracking per frame on the mobile node, in milliseconds."""

    device: str
    virtual: bool
    ran_ms: float
    model_ms: float | None
    """What the device's cost model charges for the same work; None without one."""

    @property
    def ratio(self) -> float | None:
        """How many times as long the device would take."""
        return None if self.model_ms is None else self.model_ms / self.ran_ms

    def line(self) -> str:
        """In a sentence."""
        per_frame = f"extraction and tracking take {self.ran_ms:.1f} ms per frame"
        if self.virtual:
            return f"Compute times of {self.device} are those of its cost model: {per_frame}."
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


def compute_times(results: Results) -> list[ComputeTime]:
    """One entry per mobile device and kind of engine, from a run of each system on it."""
    found: list[ComputeTime] = []
    runs = results.trusted
    kinds = runs["engine"].eq(VIRTUAL)
    for (device, virtual), rows in runs.groupby([runs["device_mobile"], kinds], sort=False):
        model = _model(str(device))
        ran: list[float] = []
        charged: list[float] = []
        for _, own in rows.groupby("label", sort=False):
            log = results.events(str(own["run_key"].iloc[0]), ("stage", "frame_tracked"))
            frames = len(log.of("frame_tracked")) if log is not None else 0
            if log is None or not frames:
                continue
            stages = [e for e in log.of("stage", node="mobile") if e.get("name") in STAGES]
            if not stages:
                continue
            ran.append(sum(float(e.get("wall_ms") or 0.0) for e in stages) / frames)
            if model is not None:
                charged.append(sum(_charged_ms(model, e) for e in stages) / frames)
        if ran and np.median(ran) > 0:
            model_ms = float(np.median(charged)) if charged else None
            found.append(ComputeTime(str(device), bool(virtual), float(np.median(ran)), model_ms))
    return found


def _model(device: str) -> CostModel | None:
    """Of a device file; a device that an experiment made up has none here."""
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
