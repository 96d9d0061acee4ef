# SPDX-License-Identifier: Apache-2.0
"""What share of the mobile node's work is whose (IJNC 15(2), 2025, Tables 1 and 2)."""

from collections.abc import Mapping

from slambed.metrics.events import EventLog
from slambed.metrics.tracking import values_of

UPDATE = {
    "clean": ("clean_map",),
    # Reading an update belongs to inserting its keyframes.
    "insert": ("parse", "parse_text", "insert_keyframes"),
    "reference": ("update_reference",),
    "last_frame": ("update_last_frame",),
}
"""Table 2: what a map update consists of."""

WORK = {
    "extract": ("extract",),
    "pose": ("track", "relocalize"),
    "keyframe": ("create_keyframe", "serialize", "serialize_text"),
    "update": ("apply_update", *(name for names in UPDATE.values() for name in names)),
}
"""Table 1: what the mobile device of Edge-SLAM does."""


def share_of_work(log: EventLog, part: str) -> float | None:
    """Time of this part of `WORK` over that of all; None without a stage."""
    return _share(log, WORK, part)


def share_of_update(log: EventLog, part: str) -> float | None:
    """Time of this part of `UPDATE` over that of all; None where updates are not reported by
    parts."""
    return _share(log, UPDATE, part) if log.stages("mobile", "insert_keyframes") else None


def _share(log: EventLog, parts: Mapping[str, tuple[str, ...]], part: str) -> float | None:
    spent_ms = {
        key: float(values_of(log.stages("mobile", *names), "wall_ms").sum())
        for key, names in parts.items()
    }
    total_ms = sum(spent_ms.values())
    return spent_ms[part] / total_ms if total_ms > 0 else None
