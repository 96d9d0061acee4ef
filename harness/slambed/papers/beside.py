# SPDX-License-Identifier: Apache-2.0
"""The place of a number of ours beside the printed one, whether or not it is judged."""

from dataclasses import dataclass
from math import exp, isfinite, log
from typing import Literal

from slambed.papers.fitted import is_alike, share_off
from slambed.papers.judged import Judged
from slambed.papers.published import Difference, Gap, MaxOver, Reduction


@dataclass(frozen=True)
class Beside:
    """How far ours is from the printed number."""

    scale: Literal["ratio", "points"]
    effect: float
    """Logarithm of ours / print, or ours - print as a share (0.1 is ten points)."""
    of: Literal["number", "left", "gap"] = "number"
    """What the ratio is of: the printed number, what its reduction leaves, or (`gap`) one side of
    ours to the other."""

    @property
    def words(self) -> str:
        """Returns `0.44 x print`, `what is left 0.44 x print`, `0.44 x the other` or
        `-67 points`."""
        if self.scale == "points":
            return f"{100 * self.effect:+.0f} points" if self.effect else "as printed"
        ratio = f"{exp(self.effect):.2g} x"
        if self.of == "gap":
            return f"{ratio} the other"
        return f"{'what is left ' if self.of == 'left' else ''}{ratio} print"


def beside(row: Judged) -> Beside | None:
    """Returns the place of our number; None without a number of ours or a printed one, and where
    neither a ratio nor points have a meaning, as with a time from zero or the time of a loss."""
    verdict, stated = row.verdict, row.cell.value
    if not row.measured.there or stated is None or not is_alike(row.cell):
        return None
    if verdict.scale in ("ratio", "points") and isfinite(verdict.effect):
        if verdict.scale == "points":
            return Beside("points", verdict.effect)
        return Beside("ratio", verdict.effect, _ratio_of(row))
    if row.measured.is_share:
        off = share_off(row.cell, row.measured, verdict)
        return None if off is None else Beside("points", off)
    ours = row.measured.mean.value
    return Beside("ratio", log(ours / stated)) if ours > 0 and stated > 0 else None


def _ratio_of(row: Judged) -> Literal["number", "left", "gap"]:
    quantity = row.cell.claim.quantity if row.cell.claim is not None else None
    if isinstance(quantity, Gap):
        return "gap"
    if isinstance(quantity, Reduction):
        return "left"
    if isinstance(quantity, MaxOver) and not isinstance(quantity.over[0], Difference):
        return "left"
    return "number"
