# SPDX-License-Identifier: Apache-2.0
"""Which estimated pose belongs to which true pose: nearest time stamp, or the TUM script's rule."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slambed.errors import SlambedError
from slambed.metrics.trajectory import Trajectory

DEFAULT_MAX_DIFFERENCE_S = 0.02  # the TUM benchmark's own default

Method = Literal["nearest", "tum"]
Indices = NDArray[np.intp]


def match_nearest(
    queries_s: NDArray[np.float64], stamps_s: NDArray[np.float64], max_difference_s: float
) -> tuple[Indices, Indices]:
    """For each query the nearest of the sorted stamps, when not farther than the maximum.

    One stamp may serve several queries. The earlier stamp wins a tie.
    """
    if len(queries_s) == 0 or len(stamps_s) == 0:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    after = np.searchsorted(stamps_s, queries_s, side="right")
    before = np.clip(after - 1, 0, len(stamps_s) - 1)
    after = np.clip(after, 0, len(stamps_s) - 1)
    take_after = np.abs(stamps_s[after] - queries_s) < np.abs(queries_s - stamps_s[before])
    nearest = np.where(take_after, after, before)
    close = np.flatnonzero(np.abs(stamps_s[nearest] - queries_s) <= max_difference_s)
    return close, nearest[close]


def match_tum(
    first_s: NDArray[np.float64], second_s: NDArray[np.float64], max_difference_s: float
) -> tuple[Indices, Indices]:
    """One-to-one pairs, the closest first (the rule of the TUM benchmark's associate script)."""
    low = np.searchsorted(second_s, first_s - max_difference_s, side="left")
    high = np.searchsorted(second_s, first_s + max_difference_s, side="right")
    counts = np.maximum(high - low, 0)
    first = np.repeat(np.arange(len(first_s)), counts)
    starts = np.repeat(np.cumsum(counts) - counts, counts)
    second = np.arange(int(counts.sum())) - starts + np.repeat(low, counts)
    difference = np.abs(first_s[first] - second_s[second])
    keep = difference < max_difference_s
    first, second, difference = first[keep], second[keep], difference[keep]
    first_taken = np.zeros(len(first_s), bool)
    second_taken = np.zeros(len(second_s), bool)
    pairs: list[tuple[int, int]] = []
    for k in np.lexsort((second, first, difference)):
        i, j = int(first[k]), int(second[k])
        if not (first_taken[i] or second_taken[j]):
            first_taken[i] = second_taken[j] = True
            pairs.append((i, j))
    found = np.array(sorted(pairs), dtype=np.intp).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def associate(
    estimate: Trajectory,
    truth: Trajectory,
    max_difference_s: float = DEFAULT_MAX_DIFFERENCE_S,
    method: Method = "nearest",
) -> tuple[Trajectory, Trajectory]:
    """Pairs of equal length. `nearest`: the shorter trajectory asks the longer one, as evo does."""
    if method == "tum":
        i, j = match_tum(truth.stamps_s, estimate.stamps_s, max_difference_s)
        return estimate.take(j), truth.take(i)
    if method != "nearest":
        raise SlambedError(f"unknown association '{method}', choose nearest or tum")
    if len(truth) > len(estimate):
        i, j = match_nearest(estimate.stamps_s, truth.stamps_s, max_difference_s)
        return estimate.take(i), truth.take(j)
    i, j = match_nearest(truth.stamps_s, estimate.stamps_s, max_difference_s)
    return estimate.take(j), truth.take(i)
