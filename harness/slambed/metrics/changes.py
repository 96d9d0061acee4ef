# SPDX-License-Identifier: Apache-2.0
"""Difference of B and A with a 95 % interval: the counterparts of the tests in `comparison`."""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from slambed.metrics.statistics import CONFIDENCE, Interval, finite, minus

Floats = NDArray[np.float64]
EXACT_RUNS = 30
"""Up to this number of runs per side, or of pairs, the tests' statistics have their exact
distributions, above it normal ones."""


def shift(a: ArrayLike, b: ArrayLike, confidence: float = CONFIDENCE) -> Interval:
    """Returns the median difference of a run of B and a run of A (Hodges and Lehmann 1963). The
    interval holds all shifts that Mann-Whitney's test does not reject (Moses; Hollander and Wolfe,
    sec. 4.3).

    Two failed runs (infinite) have difference 0. With too few runs for an interval the range is
    returned.
    """
    first, second = finite(a), finite(b)
    differences = np.sort(minus(second[:, None], first[None, :]).ravel())
    outside = _outside(len(first), len(second), confidence)
    ends = max(outside - 1, 0)
    return Interval(
        _middle(differences),
        float(differences[ends]),
        float(differences[-1 - ends]),
        min(len(first), len(second)),
        is_range=outside == 0,
    )


def paired_shift(a: Floats, b: Floats, confidence: float = CONFIDENCE) -> Interval:
    """Returns the median of the means of any two paired differences (Hodges and Lehmann 1963). The
    interval holds all shifts that Wilcoxon's signed-rank test does not reject (Tukey; Hollander and
    Wolfe, sec. 3.2 and 3.3).

    Two failed runs (infinite) have difference 0, and so has the mean of a failure of A and one of
    B. With too few pairs for an interval the range is returned.
    """
    differences = minus(b, a)
    count = len(differences)
    with np.errstate(invalid="ignore"):
        means = (differences[:, None] + differences[None, :])[np.triu_indices(count)] / 2
    means = np.sort(np.where(np.isnan(means), 0.0, means))
    outside = _outside_pairs(count, confidence)
    ends = max(outside - 1, 0)
    low, high = float(means[ends]), float(means[-1 - ends])
    return Interval(_middle(means), low, high, count, is_range=outside == 0)


def share_change(a: Floats, b: Floats, confidence: float = CONFIDENCE) -> Interval:
    """Returns the difference of two shares of 0/1 outcomes (Newcombe 1998, method 10)."""
    low, high = newcombe(b.sum(), len(b), a.sum(), len(a), confidence)
    value = float(b.mean() - a.mean())
    return Interval(value, float(low), float(high), min(len(a), len(b)))


def paired_share_change(a: Floats, b: Floats, confidence: float = CONFIDENCE) -> Interval:
    """Returns the difference of two shares with the same seeds (Newcombe 1998, paired, method
    10: both score intervals, combined with the correlation of the pairs)."""
    count = len(a)
    both, neither = float((a * b).sum()), float(((1 - a) * (1 - b)).sum())
    only_a, only_b = float(a.sum()) - both, float(b.sum()) - both
    product = both * neither - only_a * only_b
    if product > 0:
        product = max(product - count / 2, 0.0)
    margins = a.sum() * b.sum() * (count - a.sum()) * (count - b.sum())
    phi = product / np.sqrt(margins) if margins > 0 else 0.0
    z = normal_quantile(0.5 + confidence / 2)
    p, q = float(b.mean()), float(a.mean())
    (p_low, p_high), (q_low, q_high) = (wilson_limits(s.sum(), count, z) for s in (b, a))
    value = p - q
    low = value - _joined(p - p_low, q_high - q, phi)
    return Interval(value, low, value + _joined(p_high - p, q - q_low, phi), count)


def newcombe(
    ours_bad: ArrayLike,
    ours_runs: ArrayLike,
    paper_bad: ArrayLike,
    paper_runs: ArrayLike,
    confidence: float,
) -> tuple[Floats, Floats]:
    """Returns the interval of (our share - the paper's share), for arrays that broadcast."""
    z = normal_quantile(0.5 + confidence / 2)
    p1 = np.asarray(ours_bad, dtype=np.float64) / np.asarray(ours_runs)
    p2 = np.asarray(paper_bad, dtype=np.float64) / np.asarray(paper_runs)
    (l1, u1), (l2, u2) = (
        wilson_limits(ours_bad, ours_runs, z),
        wilson_limits(paper_bad, paper_runs, z),
    )
    low = p1 - p2 - np.sqrt((p1 - l1) ** 2 + (u2 - p2) ** 2)
    high = p1 - p2 + np.sqrt((u1 - p1) ** 2 + (p2 - l2) ** 2)
    return np.asarray(low), np.asarray(high)


def wilson_limits(bad: ArrayLike, runs: ArrayLike, z: float) -> tuple[Floats, Floats]:
    """Returns Wilson's score interval (1927) for arrays of counts and a two-sided normal
    quantile z. It replaces `statistics.wilson`, which calls scipy, for thousands of shares at
    once."""
    k, n = np.asarray(bad, dtype=np.float64), np.asarray(runs, dtype=np.float64)
    p = k / n
    center = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return np.where(k == 0, 0.0, center - half), np.where(k == n, 1.0, center + half)


@lru_cache
def normal_quantile(probability: float) -> float:
    """Returns a quantile of the standard normal distribution."""
    return float(stats.norm.ppf(probability))


def _middle(ordered: Floats) -> float:
    """Returns the median; 0 halfway between a failure of A and one of B."""
    low, high = ordered[(len(ordered) - 1) // 2], ordered[len(ordered) // 2]
    return 0.0 if np.isinf(low) and low == -high else float((low + high) / 2)


def _joined(one: float | Floats, other: float | Floats, phi: float) -> float:
    return float(np.sqrt(max(one**2 - 2 * phi * one * other + other**2, 0.0)))


@lru_cache
def _outside(a: int, b: int, confidence: float) -> int:
    """Returns how many sorted differences lie outside the interval on each side, including its
    end; 0 if no interval reaches the confidence."""
    tail = (1 - confidence) / 2
    if max(a, b) > EXACT_RUNS:
        spread = np.sqrt(a * b * (a + b + 1) / 12)
        return max(int(a * b / 2 - normal_quantile(1 - tail) * spread), 0)
    return int(np.searchsorted(np.cumsum(_u_distribution(a, b)), tail, side="right"))


@lru_cache
def _outside_pairs(count: int, confidence: float) -> int:
    """Returns the same for the sorted means of two paired differences."""
    tail = (1 - confidence) / 2
    if count > EXACT_RUNS:
        spread = np.sqrt(count * (count + 1) * (2 * count + 1) / 24)
        return max(int(count * (count + 1) / 4 - normal_quantile(1 - tail) * spread), 0)
    return int(np.searchsorted(np.cumsum(_rank_sum_distribution(count)), tail, side="right"))


@lru_cache
def _rank_sum_distribution(count: int) -> Floats:
    """Returns the probability of each sum 0..count*(count+1)/2 of the ranks of positive
    differences: each rank is in it with probability 1/2."""
    found = np.ones(1)
    for rank in range(1, count + 1):
        found = np.convolve(found, np.concatenate([[0.5], np.zeros(rank - 1), [0.5]]))
    return found


@lru_cache
def _u_distribution(a: int, b: int) -> Floats:
    """Returns the probability of each value 0..a*b of U, by recursion: the largest run belongs
    to A or to B."""
    if a == 0 or b == 0:
        return np.ones(1)
    found = np.zeros(a * b + 1)
    found[b:] = _u_distribution(a - 1, b) * (a / (a + b))
    found[: a * (b - 1) + 1] += _u_distribution(a, b - 1) * (b / (a + b))
    return found
