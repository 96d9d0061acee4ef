# SPDX-License-Identifier: Apache-2.0
"""How well a live run kept the pace of its devices (docs/explanation/limits.md, "At the device's
pace")."""

from slambed.metrics.events import EventLog


def missed(log: EventLog) -> int:
    """Stages whose work alone took more of a CPU than the device would have taken."""
    return sum(stage.get("missed") is True for stage in log.of("stage"))


def ratio(log: EventLog) -> float | None:
    """Wall time of all stages of the mobile node, to what its cost model charged for them: above 1
    they waited for a CPU or were held back. None where nothing was charged."""
    stages = [s for s in log.of("stage", node="mobile") if s.get("charged_ms") is not None]
    charged = sum(float(s["charged_ms"]) for s in stages)
    taken = sum(float(s.get("wall_ms") or 0.0) for s in stages)
    return taken / charged if charged > 0 else None
