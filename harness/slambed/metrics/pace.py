# SPDX-License-Identifier: Apache-2.0
"""How well a live run kept the pace of its devices (docs/explanation/limits.md, "At the device's
pace")."""

from math import fsum

from slambed.metrics.events import EventLog


def missed(log: EventLog) -> int:
    """Returns the number of stages that needed more CPU time than the device would have taken."""
    return sum(stage.get("missed") is True for stage in log.of("stage"))


def ratio(log: EventLog) -> float | None:
    """Returns the wall time of all stages of the mobile node relative to the time charged by its
    cost model. Above 1 they waited for a CPU or were throttled. None if nothing was charged."""
    stages = [s for s in log.of("stage", node="mobile") if s.get("charged_ms") is not None]
    charged = fsum(float(s["charged_ms"]) for s in stages)
    taken = fsum(float(s.get("wall_ms") or 0.0) for s in stages)
    return taken / charged if charged > 0 else None
