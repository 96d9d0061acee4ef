# SPDX-License-Identifier: Apache-2.0
"""Intervals: how far a share, a mean or a median can be trusted."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from slambed.errors import SlambedError

Floats = NDArray[np.float64]

CONFIDENCE = 0.95
BOOTSTRAP_SEED = 20260  # any fixed number; reports must not change when drawn again
BOOTSTRAP_DRAWS = 2000  # the ends of a 95 % interval move by about 1 % of its width
_DRAW_BLOCK = 4_000_000  # numbers drawn at once: bounds the memory to some 64 MB


@dataclass(frozen=True)
class Interval:
    """An estimate with its confidence interval and the number of observations behind it."""

    value: float
    low: float
    high: float
    count: int

    def scaled(self, factor: float) -> "Interval":
        """In another unit."""
        return Interval(self.value * factor, self.low * factor, self.high * factor, self.count)


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
    z = float(stats.norm.ppf(0.5 + confidence / 2))
    share = successes / trials
    centre = (share + z * z / (2 * trials)) / (1 + z * z / trials)
    half = (z / (1 + z * z / trials)) * float(
        np.sqrt(share * (1 - share) / trials + z * z / (4 * trials * trials))
    )
    low = 0.0 if successes == 0 else max(0.0, centre - half)
    high = 1.0 if successes == trials else min(1.0, centre + half)
    return Interval(share, low, high, trials)


def bootstrap(
    values: ArrayLike,
    statistic: Literal["mean", "median"] = "median",
    seed: int = BOOTSTRAP_SEED,
    draws: int = BOOTSTRAP_DRAWS,
    confidence: float = CONFIDENCE,
) -> Interval:
    """Mean or median with a percentile bootstrap interval; the same seed gives the same interval.

    One value gives an interval of that value alone: `count` tells how much it is worth.
    Raises SlambedError when there is no value.
    """
    sample = finite(values)
    if len(sample) == 0:
        raise SlambedError("no measured value to summarise, check that the runs were measured")
    function = np.mean if statistic == "mean" else np.median
    generator = np.random.default_rng(seed)
    block = max(1, min(draws, _DRAW_BLOCK // len(sample)))
    drawn: list[Floats] = []
    for start in range(0, draws, block):
        size = (min(block, draws - start), len(sample))
        drawn.append(np.asarray(function(sample[generator.integers(0, len(sample), size)], axis=1)))
    tail = (1 - confidence) / 2
    # 'lower'/'higher' keep the interval inside the data, also where some runs are infinite.
    spread = np.concatenate(drawn)
    low = float(np.quantile(spread, tail, method="lower"))
    high = float(np.quantile(spread, 1 - tail, method="higher"))
    return Interval(float(function(sample)), low, high, len(sample))
