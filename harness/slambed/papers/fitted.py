# SPDX-License-Identifier: Apache-2.0
"""The reasons shown for a number that a device was fitted to: it is no evidence, and how far ours
still is from it."""

from math import isfinite, log, log1p

from slambed.papers.measured import Measured
from slambed.papers.published import PublishedCell
from slambed.papers.verdicts.model import Verdict

SET_TO_MATCH = "set to match a published value; no evidence"
OWN_DATA = "follows from the paper's own data; no evidence"
USUAL_MARGIN = 0.2
"""Used where the verdict has no margin, for example with too few runs."""
TIMES = 2.0
"""From this ratio on, the text shows a factor instead of percent."""


def far_off(cell: PublishedCell, measured: Measured, verdict: Verdict) -> str:
    """Returns `fitted, yet 41 % below the printed value`; empty within the number's margin."""
    if cell.value is None or not measured.there or verdict.outcome == "reproduced":
        return ""
    margin = verdict.margin if isfinite(verdict.margin) else USUAL_MARGIN
    if measured.is_share:
        points = 100 * measured.share.value - cell.value
        if abs(points) <= 100 * margin:
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


def _side(difference: float) -> str:
    return "above" if difference > 0 else "below"
