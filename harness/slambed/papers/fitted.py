# SPDX-License-Identifier: Apache-2.0
"""The reasons shown for a number that a device was fitted to: it is no evidence, and how far ours
still is from it."""

from math import isfinite, log, log1p, nan

from slambed.papers.measured import Measured
from slambed.papers.published import BOUNDS, Difference, Each, PublishedCell, Quantity, WindowShare
from slambed.papers.verdicts.model import Verdict

SET_TO_MATCH = "set to match a published value; no evidence"
OWN_DATA = "follows from the paper's own data; no evidence"
USUAL_MARGIN = 0.2
"""Used where the verdict has no margin, for example with too few runs."""
TIMES = 2.0
"""From this ratio on, the text shows a factor instead of percent."""


def far_off(cell: PublishedCell, measured: Measured, verdict: Verdict) -> str:
    """Returns `fitted, yet 41 % below the printed value`; empty within the number's margin."""
    if cell.value is None or not measured.there or not is_alike(cell):
        return ""
    if verdict.outcome == "reproduced":
        return ""
    margin = verdict.margin if isfinite(verdict.margin) else USUAL_MARGIN
    if measured.is_share:
        if verdict.scale == "difference" and isfinite(verdict.margin):
            margin /= 100
        off = share_off(cell, measured, verdict)
        if off is None or abs(points := round(100 * off, 9)) <= 100 * margin:
            return ""
        return f"fitted, yet {abs(points):.3g} points {_side(points)} the printed value"
    ours = measured.mean.value
    if verdict.scale == "difference":
        far = ours - cell.value
        if abs(far) <= margin:
            return ""
        return f"fitted, yet {abs(far):.3g} {cell.unit} {_side(far)} the printed value"
    if not (ours > 0 and cell.value > 0):
        return ""
    ratio = ours / cell.value
    if abs(log(ratio)) <= log1p(margin):
        return ""
    if ratio >= TIMES:
        return f"fitted, yet {ratio:.3g} times the printed value"
    if ratio <= 1 / TIMES:
        return f"fitted, yet the printed value is {1 / ratio:.3g} times ours"
    return f"fitted, yet {100 * abs(ratio - 1):.0f} % {_side(ratio - 1)} the printed value"


def is_alike(cell: PublishedCell) -> bool:
    """Returns whether the printed number is of the kind that it is judged by. A time of losses is
    not: it is judged by the share of losses in a window."""
    quantity = _quantity(cell)
    if cell.claim is None or not isinstance(quantity, WindowShare) or cell.unit == "runs":
        return True
    return cell.unit == "%" and (quantity.per == "runs" or cell.claim.op in BOUNDS)


def share_off(cell: PublishedCell, measured: Measured, verdict: Verdict) -> float | None:
    """Returns our share - the printed one (0.1 is ten points). Several numbers have a distance only
    where the verdict has one: `measured` is then one of their sides. None without a distance."""
    quantity = _quantity(cell)
    if quantity is None or (
        isinstance(quantity, Each) and not isinstance(quantity.of[0], Difference)
    ):
        off = measured.share.value - _printed_share(cell)
    elif verdict.scale == "ratio":
        return None
    else:
        off = verdict.effect / (100 if verdict.scale == "difference" else 1)
    return off if isfinite(off) else None


def _printed_share(cell: PublishedCell) -> float:
    """Returns the printed number as a share; NaN for runs of an unknown number."""
    assert cell.value is not None
    if cell.unit != "runs":
        return cell.value / 100
    return cell.value / cell.runs if cell.runs else nan


def _quantity(cell: PublishedCell) -> Quantity | None:
    return cell.claim.quantity if cell.claim is not None else None


def _side(difference: float) -> str:
    return "above" if difference > 0 else "below"
