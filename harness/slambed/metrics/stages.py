# SPDX-License-Identifier: Apache-2.0
"""Where time is spent: per stage, per keyframe, and per map update round (DynNetSLAM, Fig. 4)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from slambed.metrics.events import Event, EventLog
from slambed.metrics.tracking import values_of
from slambed.metrics.update_round import PART_FIELDS, update_rounds

MAPPING_STAGES = ("insert", "cull_points", "triangulate", "fuse", "bundle", "cull_keyframes")
"""Stages of the local mapper per keyframe; serialization and updates are counted separately."""


_UNIT_OF = {
    "extract": "frame_tracked",
    "track": "frame_tracked",
    "create_keyframe": "keyframe_created",
    "serialize": "keyframe_created",
    "serialize_text": "keyframe_created",
} | dict.fromkeys(MAPPING_STAGES, "keyframe_mapped")


@dataclass(frozen=True)
class StageTime:
    """Times of one stage on one node in milliseconds."""

    node: str
    name: str
    count: int
    wall_ms_mean: float
    wall_ms_per_unit: float
    """Per tracked frame, new keyframe or mapped keyframe, for which a stage may run several
    times (for example an interrupted bundle adjustment); per call for all other stages."""


def stage_times(log: EventLog) -> list[StageTime]:
    """Returns every timed stage, by node and name."""
    groups: dict[tuple[str, str], list[Event]] = {}
    for event in log.of("stage"):
        groups.setdefault((event["node"], str(event.get("name"))), []).append(event)
    units = {
        "frame_tracked": len(log.of("frame_tracked")),
        "keyframe_created": len(log.of("keyframe_created")),
        "keyframe_mapped": len(log.of("keyframe_mapped")),
    }
    result: list[StageTime] = []
    for (node, name), events in sorted(groups.items()):
        wall = values_of(events, "wall_ms")
        if len(wall):
            result.append(
                StageTime(
                    node,
                    name,
                    len(wall),
                    float(wall.mean()),
                    float(wall.sum()) / (units.get(_UNIT_OF.get(name, ""), 0) or len(wall)),
                )
            )
    return result


def host_stall_ms_max(log: EventLog) -> float | None:
    """Returns the longest stall caused by the host; None if nothing was timed."""
    found = longest_stall(log)
    return found[1] if found is not None else None


def longest_stall(log: EventLog) -> tuple[float, float] | None:
    """Returns the end time [s] and the excess time [ms] of the mobile node's feature extraction
    with the longest stall.

    Extraction never blocks, so its wall time divided by its CPU time is usually constant (median
    ratio of the run). Wall time beyond that is not explained by the device's limits: something else
    on the host used the CPU. It is a lower bound because extraction covers only part of the run.
    None if nothing was timed.
    """
    stages = log.stages("mobile", "extract")
    # A user's program may have a stage of this name with other fields.
    both = [
        e
        for e in stages
        if all(isinstance(e.get(key), int | float) for key in ("wall_ms", "cpu_ms")) and e["cpu_ms"]
    ]
    if not both:
        return None
    wall, cpu = values_of(both, "wall_ms"), values_of(both, "cpu_ms")
    excess = wall - cpu * np.median(wall / cpu)
    worst = int(np.argmax(excess))
    return both[worst]["t_ns"] / 1e9, max(0.0, float(excess[worst]))


def mapping_ms_per_keyframe(log: EventLog, key: str = "wall_ms") -> float | None:
    """Returns the mean time of all mapping stages together per mapped keyframe."""
    keyframes = len(log.of("keyframe_mapped"))
    stages = [e for e in log.of("stage") if e.get("name") in MAPPING_STAGES]
    spent = values_of(stages, key)
    if keyframes == 0 or len(spent) == 0:
        return None
    return float(spent.sum()) / keyframes


@dataclass(frozen=True)
class Delay:
    """One part of a map update round in milliseconds (mean, standard deviation, median, count)."""

    mean_ms: float
    std_ms: float
    median_ms: float
    count: int


def delays(log: EventLog) -> dict[str, Delay]:
    """Returns the parts of T_Total that this run's events report; a part without events is absent.

    If accepted updates report their own parts (`update_round`), these are used because they add up.
    T_Computed is T_Total without T_Wait. Otherwise approximations are used. T_Track: tracking step;
    T_M->E and T_E->M: from queued to received; T_RKF: parsing a keyframe on the edge. T_LM: local
    mapping per keyframe; T_PLMU: preparing the update; T_MU: applying it. T_Total: from the capture
    of the newest keyframe in an update until the update is applied.
    """
    if rounds := update_rounds(log):
        return _spread_of(
            {
                **{part: np.array([r.parts_ms[part] for r in rounds]) for part in PART_FIELDS},
                "T_Total": np.array([r.total_ms for r in rounds]),
                "T_Computed": np.array([r.computed_ms for r in rounds]),
            }
        )
    keyframe_messages = _messages(log, "up", "keyframe")
    update_messages = _messages(log, "down", "map")
    parse = log.stages("edge", "parse")
    prepare = [e for e in log.of("stage") if e.get("name") == "prepare_update"]
    parts = {
        "T_Track": values_of(log.of("frame_tracked"), "track_ms"),
        "T_M->E": transfer_ms(keyframe_messages),
        "T_RKF": values_of(parse, "wall_ms"),
        "T_LM": _mapping_of_each(log),
        "T_PLMU": values_of(prepare, "wall_ms"),
        "T_E->M": transfer_ms(update_messages),
        "T_MU": values_of(log.of("update_applied"), "t_mu_ms"),
        "T_Total": total_ms(log),
    }
    return _spread_of(parts)


def _spread_of(
    parts: Mapping[str, np.ndarray[tuple[int], np.dtype[np.float64]]],
) -> dict[str, Delay]:
    return {
        name: Delay(
            float(values.mean()), float(values.std()), float(np.median(values)), len(values)
        )
        for name, values in parts.items()
        if len(values)
    }


def total_ms(log: EventLog) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Returns T_Total of every applied update: as reported, or from the capture of its newest
    keyframe."""
    if rounds := update_rounds(log):
        return np.array([r.total_ms for r in rounds])
    captured = _capture_times_ns(log)
    found = [
        (event["t_ns"] - captured[event["newest_keyframe"]]) / 1e6
        for event in log.of("update_applied")
        if event.get("newest_keyframe") in captured
    ]
    return np.array(found, dtype=np.float64)


def _capture_times_ns(log: EventLog) -> dict[int, float]:
    """Returns the run time at which the frame of each keyframe was offered to tracking."""
    offered: dict[int, float] = {}
    for step in log.of("frame_tracked"):
        if isinstance(step.get("frame"), int) and isinstance(step.get("track_ms"), int | float):
            waited = float(step.get("wait_ms") or 0.0)
            offered[step["frame"]] = step["t_ns"] - (step["track_ms"] + waited) * 1e6
    captured: dict[int, float] = {}
    for event in log.of("keyframe_created"):
        keyframe, frame = event.get("keyframe"), event.get("frame")
        if isinstance(keyframe, int):
            seq_s = event.get("seq_s")
            if not isinstance(seq_s, int | float):
                seq_s = event["t_ns"] / 1e9
            fallback = float(seq_s) * 1e9
            captured[keyframe] = (
                offered.get(frame, fallback) if isinstance(frame, int) else fallback
            )
    return captured


def _messages(log: EventLog, direction: str, channel: str) -> list[Event]:
    return [
        e
        for e in log.of("message")
        if e.get("direction") == direction and e.get("channel") == channel and not e.get("dropped")
    ]


def transfer_ms(messages: list[Event]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Returns the time from queued to received for each delivered message."""
    found = [
        (e["received_ns"] - e["queued_ns"]) / 1e6
        for e in messages
        if isinstance(e.get("received_ns"), int) and isinstance(e.get("queued_ns"), int)
    ]
    return np.array(found, dtype=np.float64)


def _mapping_of_each(log: EventLog) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Returns the wall time of the mapping stages between successive mapped keyframes."""
    found: list[float] = []
    spent = 0.0
    for event in log.of("stage", "keyframe_mapped"):
        if event["type"] == "keyframe_mapped":
            found.append(spent)
            spent = 0.0
        elif event.get("name") in MAPPING_STAGES and isinstance(event.get("wall_ms"), int | float):
            spent += float(event["wall_ms"])
    measured = np.array(found, dtype=np.float64)
    return measured if measured.any() else measured[:0]
