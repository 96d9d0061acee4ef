# SPDX-License-Identifier: Apache-2.0
"""Intervals: how far a share or a median can be relied on. Means are judged beside published ones
only, on the logarithm (`report/verdicts/means.py`)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from slambed.errors import SlambedError

Floats = NDArray[np.float64]

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Interval:
    """An estimate with its confidence interval and the number of observations behind it."""

    value: float
    low: float
    high: float
    count: int
    is_range: bool = False
    """True where `low` and `high` are the least and the largest value: too few for an interval."""

    def scaled(self, factor: float) -> "Interval":
        """In another unit."""
        low, high = self.low * factor, self.high * factor
        return Interval(self.value * factor, low, high, self.count, self.is_range)


def finite(values: ArrayLike | Sequence[float | None]) -> Floats:
    """The measured values: null and NaN are not measurements; infinity stays (a failed run)."""
    array = np.array(
        [np.nan if v is None else float(v) for v in np.asarray(values, dtype=object).ravel()],
        dtype=np.float64,
    )
    return array[~np.isnan(array)]


def wilson(successes: int, trials: int, confidence: float = CONFIDENCE) -> Interval:
    """Share with Wilson's score interval (1927): honest at 0 of n and n of n.

    Raises SlambedError when there were no trials or more successes than trials.
    """
    if trials <= 0 or not 0 <= successes <= trials:
        raise SlambedError(
            f"{successes} of {trials} is no share, need 0 <= successes <= trials > 0"
        )
    found = stats.binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    return Interval(successes / trials, float(found.low), float(found.high), trials)


def interval(values: ArrayLike, confidence: float = CONFIDENCE) -> Interval:
    """Median with its confidence interval; the range of the values where they are too few.

    By order statistics (Conover 1999, sec. 3.2), exact for every distribution; below
    six values no two of them hold it with 95 %. Nothing is drawn: the same runs
    give the same interval. Raises SlambedError when there is no value.
    """
    sample = finite(values)
    count = len(sample)
    if count == 0:
        raise SlambedError("no measured value to summarize, check that the runs were measured")
    middle = float(np.median(sample))
    found: Any = stats.quantile_test(sample, q=0.0, p=0.5).confidence_interval(confidence)
    low, high = float(found.low), float(found.high)
    if np.isnan(low):
        return Interval(middle, float(sample.min()), float(sample.max()), count, is_range=True)
    return Interval(middle, low, high, count)
