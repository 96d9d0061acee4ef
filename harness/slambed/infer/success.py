# SPDX-License-Identifier: Apache-2.0
"""Evaluates the plan's success criteria on the results."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import stats

from slambed.infer.inference_plan import Criterion
from slambed.infer.mixture import Prediction
from slambed.papers.verdicts.contrasts import Ours, rising
from slambed.papers.verdicts.model import LEVEL, Mean, Share

ROUNDING = 1e-9
"""0.55 of 20 cells is more than 11 in floating point."""


@dataclass(frozen=True)
class ComparedCell:
    """A published number with its prediction, and our runs at the best point."""

    cell: str
    printed: Share | Mean
    prediction: Prediction | None
    """None if not run, or without a spread."""
    ours: Ours | None

    @property
    def error_points(self) -> float | None:
        """Returns the error of the expected share in points; None for a mean."""
        if self.prediction is None or not isinstance(self.printed, Share):
            return None
        return 100 * abs(self.prediction.expected - self.printed.bad) / self.printed.runs


@dataclass(frozen=True)
class CriterionResult:
    """One criterion and its result."""

    criterion: Criterion
    met: bool
    why: str


def judge(
    criterion: Criterion, fitted: list[ComparedCell], held_out: list[ComparedCell]
) -> CriterionResult:
    """Judges a criterion; one that cannot be computed is not met."""
    match criterion.kind:
        case "fitted_inside":
            return _inside(criterion, fitted)
        case "held_out_inside":
            return _inside(criterion, held_out)
        case "mean_error":
            return _mean_error(criterion, held_out)
    by_name = {b.cell: b for b in (*fitted, *held_out)}
    if criterion.kind == "rank":
        return _rank(criterion, by_name)
    return _rises(criterion, by_name)


def _inside(criterion: Criterion, cells: list[ComparedCell]) -> CriterionResult:
    count = sum(c.prediction is not None and c.prediction.inside for c in cells)
    least = criterion.at_least or 0.0
    missing = sum(c.prediction is None for c in cells)
    why = f"{count} of {len(cells)} inside, {least:.0%} asked for"
    why += f"; {missing} not predicted count as outside" if missing else ""
    return CriterionResult(criterion, count >= least * len(cells) - ROUNDING, why)


def _mean_error(criterion: Criterion, cells: list[ComparedCell]) -> CriterionResult:
    errors = [e for c in cells if (e := c.error_points) is not None]
    wanted = sum(isinstance(c.printed, Share) for c in cells)
    if len(errors) < wanted or not errors:
        return CriterionResult(criterion, False, f"{len(errors)} of {wanted} shares are predicted")
    error, most = float(np.mean(errors)), criterion.at_most or 0.0
    why = f"{error:.1f} points over {len(errors)} shares, {most:g} at most"
    return CriterionResult(criterion, error <= most, why)


def _rank(criterion: Criterion, cells: Mapping[str, ComparedCell]) -> CriterionResult:
    chain = [cells[name] for name in criterion.cells]
    if any(c.prediction is None for c in chain):
        return CriterionResult(criterion, False, "one of its cells is not predicted")
    ours = [_expected(c) for c in chain]
    paper = [_value(c.printed) for c in chain]
    if len(set(ours)) < 2 or len(set(paper)) < 2:
        return CriterionResult(criterion, False, "nothing varies")
    rho, least = float(stats.spearmanr(ours, paper).statistic), criterion.at_least or 0.0
    # With two of five cells exchanged the correlation is 0.9, or slightly less by rounding.
    return CriterionResult(
        criterion, rho >= least - ROUNDING, f"rank correlation {rho:.2f}, {least:g} asked for"
    )


def _expected(cell: ComparedCell) -> float:
    """Returns what is predicted in the unit of what is printed: a share, not a count of runs."""
    assert cell.prediction is not None
    runs = cell.printed.runs if isinstance(cell.printed, Share) else 1
    return cell.prediction.expected / runs


def _value(printed: Share | Mean) -> float:
    return printed.value


def _rises(criterion: Criterion, cells: Mapping[str, ComparedCell]) -> CriterionResult:
    chain = [cells[name] for name in criterion.cells]
    ours = [c.ours for c in chain if c.ours is not None]
    if len(ours) < len(chain):
        return CriterionResult(criterion, False, "one of its cells was not run")
    steps = [rising(pair) for pair in pairwise(ours)]
    worst = int(np.argmax(steps))
    why = f"p {max(steps):.2g} ({chain[worst].cell} to {chain[worst + 1].cell})"
    return CriterionResult(criterion, max(steps) < LEVEL, why)
