# SPDX-License-Identifier: Apache-2.0
"""The round of a map update by parts: from the frame of its newest keyframe until tracking uses
it (DynNetSLAM, Sec. III: T_Total = T_Mobile + T_Edge + T_NW)."""

from collections.abc import Callable
from dataclasses import dataclass
from math import fsum

import numpy as np

from slambed.metrics.events import Event, EventLog

PART_FIELDS = {
    "T_Track": "t_track_ms",
    "T_M->E": "t_me_ms",
    "T_RKF": "t_rkf_ms",
    "T_LM": "t_lm_ms",
    "T_Wait": "t_wait_ms",
    "T_PLMU": "t_plmu_ms",
    "T_E->M": "t_em_ms",
    "T_MU": "t_mu_ms",
}
"""Part -> field of `update_applied`. T_Wait is the pacing of updates, which the papers exclude."""

CLOSURE_LIMIT_MS = 2.0
"""Tolerance for the sum of a round's parts compared with its total."""


@dataclass(frozen=True)
class UpdateRound:
    """One accepted map update."""

    parts_ms: dict[str, float]
    total_ms: float
    gap_keyframes: int | None
    """Keyframes of the old local map that the update removed from tracking."""

    @property
    def computed_ms(self) -> float:
        """T_Total as in the paper: the total without T_Wait."""
        return self.total_ms - self.parts_ms["T_Wait"]

    @property
    def closure_error_ms(self) -> float:
        """Difference between the total and the sum of the parts."""
        return abs(fsum(self.parts_ms.values()) - self.total_ms)


def update_rounds(log: EventLog) -> list[UpdateRound]:
    """Returns every accepted regular update whose event reports all parts.

    Maps for relocalization start with a request instead of a keyframe and are excluded.
    """
    found = [_round(event) for event in log.of("update_applied") if not event.get("relocalization")]
    return [round_ for round_ in found if round_ is not None]


def _round(event: Event) -> UpdateRound | None:
    numbers = [event.get(field) for field in (*PART_FIELDS.values(), "t_total_ms")]
    if not all(isinstance(number, int | float) for number in numbers):
        return None
    *parts, total = (float(str(number)) for number in numbers)
    gap = event.get("gap_keyframes")
    return UpdateRound(
        dict(zip(PART_FIELDS, parts, strict=True)), total, gap if isinstance(gap, int) else None
    )


def median_ms(rounds: list[UpdateRound], part: Callable[[UpdateRound], float]) -> float | None:
    """Returns the median over the updates; None without updates."""
    return float(np.median([part(r) for r in rounds])) if rounds else None


def gap_keyframes_mean(rounds: list[UpdateRound]) -> float | None:
    """Returns the mean number of keyframes that an update removes from the local map."""
    gaps = [r.gap_keyframes for r in rounds if r.gap_keyframes is not None]
    return float(np.mean(gaps)) if gaps else None


def closure_error_ms_max(rounds: list[UpdateRound]) -> float | None:
    """Returns the largest difference between a total and the sum of its parts."""
    return max((r.closure_error_ms for r in rounds), default=None)


def received(log: EventLog, message: str) -> list[Event]:
    """Returns delivered messages of this type."""
    return [e for e in log.of("message") if e.get("message") == message and not e.get("dropped")]


def codec_stages(log: EventLog, node: str, name: str) -> list[Event]:
    """Returns the events of a stage for either codec."""
    return log.stages(node, name, f"{name}_text")
