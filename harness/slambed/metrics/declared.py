# SPDX-License-Identifier: Apache-2.0
"""A system's own metrics, as its system.yaml defines them on its events."""

import hashlib
from collections.abc import Callable
from functools import lru_cache, partial
from math import isfinite
from pathlib import Path

import numpy as np

from slambed.errors import SlambedError
from slambed.metrics.events import Event
from slambed.metrics.metric import Metric, Use
from slambed.metrics.run_data import RunData
from slambed.metrics.summary import Value
from slambed.metrics.tracking import values_of
from slambed.spec.library import Library
from slambed.spec.run_spec import canonical_json
from slambed.spec.system import OwnMetric, System

REDUCED: dict[str, Callable[[np.ndarray[tuple[int], np.dtype[np.float64]]], float]] = {
    "sum": lambda v: float(v.sum()),
    "mean": lambda v: float(v.mean()),
    "median": lambda v: float(np.median(v)),
    "p95": lambda v: float(np.quantile(v, 0.95)),
    "min": lambda v: float(v.min()),
    "max": lambda v: float(v.max()),
    "last": lambda v: float(v[-1]),
    "rate": lambda v: float(1000 / v.mean()) if v.mean() > 0 else float("inf"),
}


def described_by(system: str | None, folder: str | None) -> str:
    """Returns what identifies the description of a run's system: its name, or the file of a
    system with its own program if that still exists."""
    name = str(system)
    if not folder:
        return name
    files = (Path(folder) / f"{name}.yaml", Path(folder) / "system.yaml")
    return str(next((file for file in files if file.is_file()), name))


def own_metrics(system: str, taken: frozenset[str]) -> tuple[Metric, ...]:
    """Returns the metrics that a system declares; empty for a system that is not in this checkout.

    Raises SlambedError if a key is already a metric of every system (`taken`).
    """
    described = _system(system)
    if described is None:
        return ()
    if clash := sorted(taken & set(described.metrics)):
        raise SlambedError(
            f"metrics of system {system}: '{clash[0]}' is a metric of every system, "
            f"{system if Path(system).is_absolute() else f'systems/{system}/system.yaml'}, choose "
            "another name"
        )
    return tuple(_metric(key, item) for key, item in described.metrics.items())


def own_digest(system: str) -> str:
    """Returns eight hex digits that change with the computation of a system's own metrics; empty
    if there are none."""
    described = _system(system)
    if described is None or not described.metrics:
        return ""
    computed = {
        key: item.model_dump(include={"event", "node", "take", "field", "where", "unless"})
        for key, item in described.metrics.items()
    }
    return hashlib.sha256(canonical_json(computed).encode()).hexdigest()[:8]


@lru_cache(maxsize=64)
def _system(name: str) -> System | None:
    library = Library()
    try:
        return library.system(name)
    except SlambedError:
        if name in library.systems():
            raise
        return None


def _metric(key: str, item: OwnMetric) -> Metric:
    return Metric(
        key,
        item.doc,
        partial(value_of, item),
        item.label,
        item.unit,
        item.shown,
        item.scale,
        item.digits,
        item.better,
        relevant_share=item.relevant_share,
        relevant_step=item.relevant_step,
        type="count" if item.take == "count" else "number",
        use=Use.GATED if item.gated else Use.ASKED,
    )


def value_of(item: OwnMetric, run: RunData) -> Value:
    """Computes the declared metric from this run's events; None if there are no values."""
    events = run.log.of(item.event, node=item.node)
    chosen = [event for event in events if fits(item, event)]
    if item.take == "count":
        return len(chosen) if run.measured else None
    if item.take == "seconds":
        return _seconds(item, events, run.end_s)
    values = values_of(chosen, item.field)
    reduced = REDUCED[item.take](values) if len(values) else None
    return reduced if reduced is not None and isfinite(reduced) else None


def fits(item: OwnMetric, event: Event) -> bool:
    """Returns whether an event matches the conditions of the declaration."""
    wanted = all(event.get(name) in _list(value) for name, value in item.where.items())
    return wanted and not any(event.get(name) in _list(v) for name, v in item.unless.items())


def _list(value: object) -> list[object]:
    return value if isinstance(value, list) else [value]


def _seconds(item: OwnMetric, events: list[Event], end_s: float | None) -> float | None:
    """Sums playback time from each matching event to the next event of this type: time in a
    state."""
    if not events or end_s is None:
        return None
    times = [event["t_ns"] / 1e9 for event in events]
    total_s = 0.0
    for event, begin_s, stop_s in zip(events, times, [*times[1:], end_s], strict=True):
        if fits(item, event):
            total_s += max(0.0, min(stop_s, end_s) - begin_s)
    return total_s
