# SPDX-License-Identifier: Apache-2.0
"""Scores how well our runs predict published cells outside every fit.

Predictions of numbers that were not fitted are the only evidence for a fitted model.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from slambed.papers.verdicts.model import FEWEST_RUNS, Floats, Mean, Share

EXPECTED = 0.95
BINS = 10


def share_position(ours: Share, paper: Share) -> float:
    """Returns the quantile of the published count in our prediction (mid-p), 0 to 1.

    The prediction is BetaBinomial(n_paper, k + 1/2, n - k + 1/2), Jeffreys' prior.
    """
    return float(share_positions(ours.bad, ours.runs, paper.bad, paper.runs))


def share_positions(
    ours_bad: ArrayLike, ours_runs: ArrayLike, paper_bad: ArrayLike, paper_runs: ArrayLike
) -> Floats:
    law, x = _law(ours_bad, ours_runs, paper_runs), np.asarray(paper_bad)
    return np.asarray(law.cdf(x) - 0.5 * law.pmf(x))


def share_log_likelihood(
    ours_bad: ArrayLike, ours_runs: ArrayLike, paper_bad: ArrayLike, paper_runs: ArrayLike
) -> Floats:
    """Returns the log probability of the published count under this prediction."""
    return np.asarray(_law(ours_bad, ours_runs, paper_runs).logpmf(np.asarray(paper_bad)))


def _law(ours_bad: ArrayLike, ours_runs: ArrayLike, paper_runs: ArrayLike) -> Any:
    k, n = np.asarray(ours_bad), np.asarray(ours_runs)
    return stats.betabinom(np.asarray(paper_runs), k + 0.5, n - k + 0.5)


def mean_position(ours: Mean, paper: Mean) -> float | None:
    """Returns the quantile of a published mean in our t prediction with factor sqrt(1/n_ours +
    1/n_paper); None without a spread. The paper's n is required (`means.completed`)."""
    if (spread := mean_spread(ours, paper)) is None or not ours.count:
        return None
    if spread == 0:
        return 0.5 if paper.value == ours.value else float(paper.value > ours.value)
    return float(stats.t.cdf((paper.value - ours.value) / spread, ours.count - 1))


def mean_spread(ours: Mean, paper: Mean) -> float | None:
    """Returns the standard deviation of our prediction of a published mean; None if unknown."""
    if ours.sd is None or not ours.count or not paper.count:
        return None
    variance = ours.sd**2 * (1 / ours.count + 1 / paper.count) + paper.digit**2 / 12
    return float(np.sqrt(variance))


def inside(position: float) -> bool:
    """Returns whether a quantile is in the central 95 %."""
    tail = (1 - EXPECTED) / 2
    return tail <= position <= 1 - tail


def enough(runs: int) -> bool:
    """Returns whether a cell has enough runs to predict."""
    return runs >= FEWEST_RUNS


@dataclass(frozen=True)
class Score:
    """`k of m` published numbers inside our 95 % prediction intervals."""

    inside: int
    cells: int
    p_value: float
    """p of this few or fewer inside, if every interval is right (binomial)."""
    histogram: tuple[int, ...]
    """Quantiles in ten equal bins: flat if spread and level are right."""

    def line(self) -> str:
        if not self.cells:
            return "not tested: each published number was fitted, or is not judged"
        return (
            f"{self.inside} of {self.cells} published numbers inside our 95 % prediction interval "
            f"(expected {EXPECTED:.0%}; p {self.p_value:.2g})"
        )


def score(positions: Sequence[float]) -> Score:
    """Scores quantiles; cells are assumed independent."""
    count = sum(inside(p) for p in positions)
    total = len(positions)
    p_value = float(stats.binomtest(count, total, EXPECTED, "less").pvalue) if total else 1.0
    bins = np.histogram(np.asarray(positions), BINS, (0, 1))[0]
    return Score(count, total, p_value, tuple(int(b) for b in bins))
