# SPDX-License-Identifier: Apache-2.0
"""Tests whether condition B differs from A: rank and exact tests, effect sizes, and power."""

from dataclasses import dataclass
from functools import lru_cache
from math import comb
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from slambed.errors import SlambedError
from slambed.metrics.statistics import finite, minus

Floats = NDArray[np.float64]
Alternative = Literal["two-sided", "less", "greater"]

RankMethod = Literal["auto", "asymptotic", "exact"]

MOST_WAYS = 5000
"""Ways to share out the runs up to which a rank test goes through all of them: 7 against 7."""
USUAL_POWER = 0.8
USUAL_ALPHA = 0.05


@dataclass(frozen=True)
class RankTest:
    """Mann-Whitney U test of b against a. Cliff's delta: P(b > a) - P(b < a), in -1..1."""

    p_value: float
    cliffs_delta: float

    @property
    def size(self) -> str:
        """Returns the effect size in words (Romano et al., 2006)."""
        magnitude = abs(self.cliffs_delta)
        limits = ((0.147, "negligible"), (0.33, "small"), (0.474, "medium"))
        return next((name for limit, name in limits if magnitude < limit), "large")


def mann_whitney(a: ArrayLike, b: ArrayLike, alternative: Alternative = "two-sided") -> RankTest:
    """Compares two sets of runs by rank; `greater` tests whether b tends to be larger than a.

    Infinite values (failed runs) rank last and tie. Raises SlambedError when a side is empty.
    """
    first, second = finite(a), finite(b)
    if len(first) == 0 or len(second) == 0:
        raise SlambedError("nothing to compare, one condition has no measured value")
    method = rank_method(first, second)
    result = stats.mannwhitneyu(second, first, alternative=alternative, method=method)
    delta = 2.0 * float(result.statistic) / (len(first) * len(second)) - 1.0
    return RankTest(float(result.pvalue), delta)


def rank_method(
    a: Floats, b: Floats, otherwise: RankMethod = "auto"
) -> RankMethod | stats.PermutationMethod:
    """Returns how scipy is to compute p of a rank test along the last axis: with ties among few
    runs over all ways to share them out.

    scipy's table holds only without ties, and its normal approximation gives few runs p values
    below the smallest that is possible.
    """
    both = np.sort(np.concatenate([a, b], axis=-1), axis=-1)
    ways = comb(both.shape[-1], a.shape[-1])
    if ways <= MOST_WAYS and bool(np.any(both[..., 1:] == both[..., :-1])):
        return stats.PermutationMethod(n_resamples=ways)
    return otherwise


def fisher(
    bad_a: int, runs_a: int, bad_b: int, runs_b: int, alternative: Alternative = "two-sided"
) -> float:
    """Returns the p-value of Fisher's exact test; `greater` tests whether b has the larger
    share."""
    table = np.array([[bad_b, runs_b - bad_b], [bad_a, runs_a - bad_a]])
    return float(stats.fisher_exact(table, alternative=alternative).pvalue)


def signed_rank(a: ArrayLike, b: ArrayLike, alternative: Alternative = "two-sided") -> float:
    """Returns the p-value of Wilcoxon's signed-rank test of paired runs; 1 if all pairs agree.

    Infinite values (failed runs) rank last; two of them agree.
    """
    difference = minus(np.asarray(b, dtype=np.float64), np.asarray(a, dtype=np.float64))
    changed = difference[difference != 0]
    if not len(changed):
        return 1.0
    ties = len(np.unique(np.abs(changed))) < len(changed)
    method: Literal["auto", "exact"] = "auto" if ties else "exact"
    return float(stats.wilcoxon(changed, alternative=alternative, method=method).pvalue)


def mcnemar(bad_a: ArrayLike, bad_b: ArrayLike, alternative: Alternative = "two-sided") -> float:
    """Returns the p-value of McNemar's exact test of paired shares, which uses only discordant
    pairs; `greater` tests whether b has the larger share."""
    a, b = np.asarray(bad_a, dtype=bool), np.asarray(bad_b, dtype=bool)
    only_b, only_a = int((b & ~a).sum()), int((a & ~b).sum())
    if only_a + only_b == 0:
        return 1.0
    return float(stats.binomtest(only_b, only_a + only_b, alternative=alternative).pvalue)


def least_p(runs: int, paired: bool, others: int | None = None) -> float:
    """Returns the smallest possible two-sided p-value of `runs` runs against `others` (as many, if
    not given): all pairs have the same sign (2 of 2^n), or all ranks (shares) are separated."""
    if paired:
        return min(1.0, 2.0 ** (1 - runs))
    return min(1.0, 2.0 / comb(runs + (runs if others is None else others), runs))


def runs_to_show(tests: int, paired: bool, alpha: float = USUAL_ALPHA) -> int:
    """Returns the minimum number of runs per side with which the first of `tests` tests can pass
    Holm's adjustment."""
    return next(n for n in range(2, 1000) if least_p(n, paired) * tests <= alpha)


def holm(p_values: ArrayLike) -> Floats:
    """Returns Holm's step-down adjustment, which bounds the probability of any false alarm."""
    raw = np.asarray(p_values, dtype=np.float64)
    order = np.argsort(raw, kind="stable")
    factors = np.arange(len(raw), 0, -1)
    stepped = np.minimum(np.maximum.accumulate(raw[order] * factors), 1.0)
    adjusted = np.empty_like(raw)
    adjusted[order] = stepped
    return adjusted


def power_of_shares(share_a: float, share_b: float, runs: int, alpha: float = USUAL_ALPHA) -> float:
    """Returns the probability that `runs` runs per condition show a difference of the two shares
    (Fisher, two-sided)."""
    outcomes = np.arange(runs + 1)
    chance_a = stats.binom.pmf(outcomes, runs, share_a)
    chance_b = stats.binom.pmf(outcomes, runs, share_b)
    return float(chance_a @ (_fisher_table(runs) <= alpha) @ chance_b)


@lru_cache(maxsize=32)
def _fisher_table(runs: int) -> Floats:
    """Returns two-sided Fisher p-values of every pair (i bad of runs, j bad of runs)."""
    table = np.ones((runs + 1, runs + 1))
    for total in range(1, 2 * runs):
        i = np.arange(max(0, total - runs), min(runs, total) + 1)
        chance = stats.hypergeom.pmf(i, 2 * runs, total, runs)
        # At most as likely as the observed table, with a tolerance for rounding.
        less_likely = chance[None, :] <= chance[:, None] * (1 + 1e-7)
        table[i, total - i] = (less_likely * chance[None, :]).sum(axis=1)
    return table


def smallest_distinguishable_share(
    share: float, runs: int, power: float = USUAL_POWER
) -> float | None:
    """Returns the smallest larger share (steps of 1 %) that `runs` runs can distinguish from
    `share`."""
    for percent in range(int(share * 100) + 1, 101):
        if power_of_shares(share, percent / 100, runs) >= power:
            return percent / 100
    return None


def power_hint(runs: int, share: float = 0.03) -> str:
    """Returns one sentence for reports on what this number of runs can show in one test."""
    if runs < 2:
        return "One run per combination shows nothing about differences."
    least = smallest_distinguishable_share(share, runs)
    if least is None:
        words = "a test of unpaired runs cannot show a difference in track losses"
        return f"With {runs} runs a side, {words}."
    return (
        f"A single test of {runs} unpaired runs a side distinguishes {share:.0%} of runs with a "
        f"track loss from {least:.0%} or more (80 % power, 5 % level)."
    )


@dataclass(frozen=True)
class Modes:
    """Two modes in one condition: their medians and numbers of runs."""

    low_median: float
    high_median: float
    low_count: int
    high_count: int


MODES_MINIMUM_RUNS = 8
MODES_MINIMUM_SHARE = 0.1
MODES_VALLEY = 0.12  # half-width of the valley, as a share of the means' distance
MODES_VALLEY_SHARE = 0.02  # this share of the runs may lie in the valley


def two_modes(values: ArrayLike) -> Modes | None:
    """Splits values that clearly form two groups; otherwise returns None.

    The best split of the sorted values (least scatter within groups) is accepted if the means are
    far apart relative to the scatter (Ashman's D) and almost no value lies halfway between them.
    The false alarm rate on normal samples of 8 to 200 runs is below 4 % (tests).
    """
    sample = np.sort(finite(values))
    sample = sample[np.isfinite(sample)]
    count = len(sample)
    if count < MODES_MINIMUM_RUNS or sample[-1] == sample[0]:
        return None
    sizes = np.arange(1, count)
    sums = np.cumsum(sample)[:-1]
    total = float(sample.sum())
    between = sizes * (count - sizes) * (sums / sizes - (total - sums) / (count - sizes)) ** 2
    least = max(2, int(np.ceil(MODES_MINIMUM_SHARE * count)))
    allowed = (sizes >= least) & (count - sizes >= least)
    split = int(sizes[allowed][np.argmax(between[allowed])])
    low, high = sample[:split], sample[split:]
    scatter = float(np.sqrt((low.var(ddof=1) + high.var(ddof=1)) / 2))
    distance = float(high.mean() - low.mean())
    halfway = np.abs(sample - (low.mean() + high.mean()) / 2) < MODES_VALLEY * distance
    crowded = int(halfway.sum()) > MODES_VALLEY_SHARE * count
    if distance < ashman_limit(count) * scatter or crowded:
        return None
    return Modes(float(np.median(low)), float(np.median(high)), len(low), len(high))


def ashman_limit(count: int) -> float:
    """Returns the distance of group means, in units of scatter, that chance does not reach;
    larger for few runs."""
    return 3.5 + 20.0 / count
