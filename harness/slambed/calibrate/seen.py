# SPDX-License-Identifier: Apache-2.0
"""Measures how long the components of a fit take in virtual runs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import fsum

import numpy as np

from slambed.calibrate.targets import Component
from slambed.errors import SlambedError
from slambed.metrics.events import EventLog
from slambed.metrics.stages import delays


@dataclass(frozen=True)
class Seen:
    """A component in the runs of one condition, in milliseconds."""

    mean: float
    sd: float
    busy: float
    """Time charged to its stages, per occurrence."""
    fixed: float = 1.0
    """Executions of the stage `fixed_on`, per occurrence."""


def look(component: Component, logs: list[EventLog]) -> Seen:
    """Measures a component over all runs of a condition. Raises SlambedError if it never occurs."""
    busy = 0.0
    occurrences = fixed = 0
    values: list[float] = []
    for log in logs:
        stages = log.of("stage", node=component.node)
        busy += fsum(e["cpu_ms"] for e in stages if e["name"] in component.stages)
        fixed += sum(e["name"] == component.fixed_on for e in stages)
        count, found = MEASURES.get(component.measure, _part)(component, log)
        occurrences += count
        values += found
    if not occurrences or not values:
        raise SlambedError(f"component {component.name} does not occur in the runs of the fit")
    if component.measure in WHOLE:
        busy = fsum(values)
    mean, sd = float(np.mean(values)), float(np.std(values))
    return Seen(mean, sd, busy / occurrences, fixed / occurrences)


def _per_frame(component: Component, log: EventLog) -> tuple[int, list[float]]:
    """Returns the time of the stages in each tracked frame."""
    spent = 0.0
    found: list[float] = []
    for event in log.of("stage", "frame_tracked"):
        if event["node"] != component.node:
            continue
        if event["type"] == "frame_tracked":
            found.append(spent)
            spent = 0.0
        elif event["name"] in component.stages and event["worker"] == TRACKING:
            spent += event["wall_ms"]
    return len(found), found


def _per_keyframe(component: Component, log: EventLog) -> tuple[int, list[float]]:
    """Returns the time of the stages in each frame that becomes a keyframe."""
    found = [spent for spent in _per_frame(component, log)[1] if spent]
    return len(found), found


def _per_mapped_keyframe(component: Component, log: EventLog) -> tuple[int, list[float]]:
    """Returns the time of the stages for each keyframe that was mapped, over all workers."""
    spent = 0.0
    found: list[float] = []
    for event in log.of("stage", "keyframe_mapped"):
        if event["node"] != component.node:
            continue
        if event["type"] == "keyframe_mapped":
            found.append(spent)
            spent = 0.0
        elif event["name"] in component.stages:
            spent += event["wall_ms"]
    return len(found), found


def _per_update(component: Component, log: EventLog) -> tuple[int, list[float]]:
    """Returns the time of the stages for each applied update, over all workers. Maps requested by a
    lost frame are left out: costs affect how many there are, and a fit that counted them oscillated
    between many and none."""
    spent = 0.0
    found: list[float] = []
    for event in log.of("stage", "update_applied", "update_declined"):
        if event["node"] != component.node:
            continue
        if event["type"] == "stage":
            spent += event["wall_ms"] if event["name"] in component.stages else 0.0
            continue
        if event["type"] == "update_applied" and not event.get("relocalization"):
            found.append(spent)
        spent = 0.0
    return len(found), found


def _per_attempt(component: Component, log: EventLog) -> tuple[int, list[float]]:
    """Returns the time of each execution of the stages in which a candidate reached a pose."""
    found = [
        float(event["wall_ms"])
        for event in log.stages(component.node, *component.stages)
        if (event.get("n2") or 0) >= 1
    ]
    return len(found), found


def _per_answer(_: Component, log: EventLog) -> tuple[int, list[float]]:
    """Returns the times from capture until the edge's pose is on the mobile node."""
    found = [float(event["latency_ms"]) for event in log.of("frame_answered")]
    return len(found), found


def _part(component: Component, log: EventLog) -> tuple[int, list[float]]:
    """Returns a part of T_Total as applied updates report it; its stages run for all keyframes."""
    delay = delays(log).get(component.measure)
    if delay is None:
        return 0, []
    executions = len(log.of(*EXECUTED_FOR[component.measure]))
    # Two values with the same mean and standard deviation as all values.
    return executions, [delay.mean_ms - delay.std_ms, delay.mean_ms + delay.std_ms]


TRACKING = "tracking"
EXECUTED_FOR: Mapping[str, tuple[str, ...]] = {
    "T_Track": ("frame_tracked",),
    "T_RKF": ("keyframe_received", "keyframe_declined"),
    "T_LM": ("keyframe_mapped",),
    "T_PLMU": ("update_sent",),
    "T_MU": ("update_received",),
}
"""Events that occur once per execution of a part's stages."""
MEASURES: Mapping[str, Callable[[Component, EventLog], tuple[int, list[float]]]] = {
    "per_frame": _per_frame,
    "per_keyframe": _per_keyframe,
    "per_mapped_keyframe": _per_mapped_keyframe,
    "per_update": _per_update,
    "per_attempt": _per_attempt,
    "per_answer": _per_answer,
}
WHOLE = ("per_update", "per_attempt")
"""Measures that leave out some executions of their stages, so the measured times count as the
cost."""
