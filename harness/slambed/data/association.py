# SPDX-License-Identifier: Apache-2.0
"""Pairs of time stamps from two sensors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

#: TUM RGB-D's own tool pairs colour and depth at most this far apart.
MAX_DIFFERENCE_S = 0.02


def associate(
    first_ns: Sequence[int], second_ns: Sequence[int], max_difference_s: float = MAX_DIFFERENCE_S
) -> list[tuple[int, int]]:
    """Index pairs, one-to-one, closest pairs first, sorted by the first sensor's time."""
    a, b = np.asarray(first_ns, dtype=np.int64), np.asarray(second_ns, dtype=np.int64)
    limit_ns = round(max_difference_s * 1e9)
    order = np.argsort(b, kind="stable")
    begin = np.searchsorted(b[order], a - limit_ns, side="left")
    end = np.searchsorted(b[order], a + limit_ns, side="right")
    candidates = [
        (abs(int(a[i] - b[j])), i, int(j)) for i in range(len(a)) for j in order[begin[i] : end[i]]
    ]
    used_a: set[int] = set()
    used_b: set[int] = set()
    pairs = []
    for _, i, j in sorted(candidates):
        if i not in used_a and j not in used_b:
            used_a.add(i)
            used_b.add(j)
            pairs.append((i, j))
    return sorted(pairs, key=lambda pair: int(a[pair[0]]))
