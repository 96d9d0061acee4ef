# SPDX-License-Identifier: Apache-2.0
"""Confidence intervals of shares and medians. Means are compared only with published ones, on a
log scale (`papers/verdicts/means.py`)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
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
    """True if `low` and `high` are the minimum and maximum: too few values for an interval."""

    def scaled(self, factor: float) -> "Interval":
        """Converts to another unit."""
        low, high = self.low * factor, self.high * factor
        return Interval(self.value * factor, low, high, self.count, self.is_range)


def finite(values: ArrayLike | Sequence[float | None]) -> Floats:
    """Returns the measured values without null, NA and NaN; infinity (a failed run) is kept."""
    array = np.asarray(values, dtype=object).ravel()
    return array[~pd.isna(array)].astype(np.float64)


def minus(b: Floats, a: Floats) -> Floats:
    """Returns b - a; 0 of two failed runs, which are infinite."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.nan_to_num(b - a, nan=0.0, posinf=np.inf, neginf=-np.inf))


def wilson(successes: int, trials: int, confidence: float = CONFIDENCE) -> Interval:
    """Returns a share with Wilson's score interval (1927), which is also valid at 0 of n and n of
    n.

    Raises SlambedError when there were no trials or more successes than trials.
    """
    if trials <= 0 or not 0 <= successes <= trials:
        raise SlambedError(
            f"{successes} of {trials} is no share, need 0 <= successes <= trials > 0"
        )
    found = stats.binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    return Interval(successes / trials, float(found.low), float(found.high), trials)


def interval(values: ArrayLike, confidence: float = CONFIDENCE) -> Interval:
    """Returns the median with its confidence interval, or with the range if there are too few
    values.

    It uses order statistics (Conover 1999, sec. 3.2), exact for every distribution; below six
    values none reach 95 %. There is no resampling, so the same runs give the same interval. Raises
    SlambedError without values.
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
