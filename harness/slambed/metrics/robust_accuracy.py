# SPDX-License-Identifier: Apache-2.0
"""Accuracy that a failed run cannot improve: a failure counts as an infinite error."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

LEAST_COVERAGE = 0.9
"""A run that tracked a smaller share of its frames is a failure, however accurate its poses are."""


@dataclass(frozen=True)
class CoverageAwareAte:
    """The survivors' median is what papers report; `median_m` is over all runs, failures last."""

    runs: int
    survivors: int
    survivor_median_m: float | None
    median_m: float | None
    """None when the median run is a failure."""


def coverage_aware_ate(
    ate_m: Sequence[float | None],
    coverage: Sequence[float | None],
    least_coverage: float = LEAST_COVERAGE,
) -> CoverageAwareAte:
    """Returns the ATE of a cell including its failures; one entry per run, None if not measured."""
    ranked = [failure_ranked(a, c, least_coverage) for a, c in zip(ate_m, coverage, strict=True)]
    survivors = [value for value in ranked if np.isfinite(value)]
    median = float(np.median(ranked)) if ranked else np.inf
    return CoverageAwareAte(
        runs=len(ranked),
        survivors=len(survivors),
        survivor_median_m=float(np.median(survivors)) if survivors else None,
        median_m=median if np.isfinite(median) else None,
    )


def failure_ranked(
    ate_m: float | None, coverage: float | None, least_coverage: float = LEAST_COVERAGE
) -> float:
    """Returns the ATE, or infinity for a run with too little coverage."""
    if ate_m is None or coverage is None or np.isnan(ate_m) or not coverage >= least_coverage:
        return float("inf")
    return float(ate_m)
