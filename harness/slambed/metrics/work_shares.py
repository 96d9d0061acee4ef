# SPDX-License-Identifier: Apache-2.0
"""Shares of the mobile node's work by task (IJNC 15(2), 2025, Tables 1 and 2)."""

from collections.abc import Mapping
from math import fsum

from slambed.metrics.events import EventLog
from slambed.metrics.tracking import values_of

UPDATE = {
    "clean": ("clean_map",),
    # Parsing an update counts as inserting its keyframes.
    "insert": ("parse", "parse_text", "insert_keyframes"),
    "reference": ("update_reference",),
    "last_frame": ("update_last_frame",),
}
"""Table 2: the parts of a map update."""

WORK = {
    "extract": ("extract",),
    "pose": ("track", "relocalize"),
    "keyframe": ("create_keyframe", "serialize", "serialize_text"),
    "update": ("apply_update", *(name for names in UPDATE.values() for name in names)),
}
"""Table 1: the tasks of Edge-SLAM's mobile device."""


def share_of_work(log: EventLog, part: str) -> float | None:
    """Returns the time of this part of `WORK` relative to all parts; None without a stage."""
    return _share(log, WORK, part)


def share_of_update(log: EventLog, part: str) -> float | None:
    """Returns the time of this part of `UPDATE` relative to all parts; None if updates do not
    report parts."""
    return _share(log, UPDATE, part) if log.stages("mobile", "insert_keyframes") else None


def _share(log: EventLog, parts: Mapping[str, tuple[str, ...]], part: str) -> float | None:
    spent_ms = {
        key: float(values_of(log.stages("mobile", *names), "wall_ms").sum())
        for key, names in parts.items()
    }
    total_ms = fsum(spent_ms.values())
    return spent_ms[part] / total_ms if total_ms > 0 else None
