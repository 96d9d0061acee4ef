# SPDX-License-Identifier: Apache-2.0
"""Matches timestamps of two sources: nearest neighbor, or the rule of TUM's script."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

MAX_DIFFERENCE_S = 0.02
"""Default of the TUM benchmark, for both images and poses."""

_ANY_S = 1e8
"""More than between any two frames of a recording, and in ns well below 64 bits."""

Indices = NDArray[np.intp]


def match_nearest(
    queries_s: NDArray[np.float64], stamps_s: NDArray[np.float64], max_difference_s: float
) -> tuple[Indices, Indices]:
    """Returns for each query the nearest of the sorted timestamps, within the maximum difference.

    A timestamp may match several queries. The earlier timestamp wins a tie.
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


def nearest_distance_s(queries_s: NDArray[np.float64], stamps_s: NDArray[np.float64]) -> float:
    """Returns the smallest distance between any query and any of the sorted timestamps."""
    near, found = match_nearest(queries_s, stamps_s, np.inf)
    return float(np.abs(queries_s[near] - stamps_s[found]).min(initial=np.inf))


def match_tum(
    first: ArrayLike, second: ArrayLike, max_difference: float
) -> tuple[Indices, Indices]:
    """Returns one-to-one pairs with less than the maximum difference, closest pairs first (the rule
    of the TUM benchmark's associate script), sorted by `first`.

    Both inputs are sorted and in the unit of the maximum: seconds, or integer nanoseconds.
    """
    a, b = np.asarray(first), np.asarray(second)
    low = np.searchsorted(b, a - max_difference, side="left")
    high = np.searchsorted(b, a + max_difference, side="right")
    counts = np.maximum(high - low, 0)
    i = np.repeat(np.arange(len(a)), counts)
    starts = np.repeat(np.cumsum(counts) - counts, counts)
    j = np.arange(int(counts.sum())) - starts + np.repeat(low, counts)
    difference = np.abs(a[i] - b[j])
    keep = difference < max_difference
    i, j, difference = i[keep], j[keep], difference[keep]
    a_taken, b_taken = np.zeros(len(a), bool), np.zeros(len(b), bool)
    pairs: list[tuple[int, int]] = []
    for k in np.lexsort((j, i, difference)):
        one, other = int(i[k]), int(j[k])
        if not (a_taken[one] or b_taken[other]):
            a_taken[one] = b_taken[other] = True
            pairs.append((one, other))
    found = np.array(sorted(pairs), dtype=np.intp).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def pairs_of_sensors(
    first_ns: list[int], second_ns: list[int], max_difference_s: float = MAX_DIFFERENCE_S
) -> list[tuple[int, int]]:
    """Applies match_tum to the sorted timestamps of two sensors; returns pairs of indices."""
    limit_ns = round(min(max_difference_s, _ANY_S) * 1e9)
    i, j = match_tum(np.array(first_ns, np.int64), np.array(second_ns, np.int64), limit_ns)
    return list(zip(i.tolist(), j.tolist(), strict=True))
