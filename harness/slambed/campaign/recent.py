# SPDX-License-Identifier: Apache-2.0
"""The last seconds of a quantity of a run in progress."""

from collections import OrderedDict

SECONDS = 40
"""How much of a run is kept: what fits beside its numbers on a terminal."""


class Recent:
    """Means over each second of run time."""

    def __init__(self) -> None:
        self._sums: OrderedDict[int, tuple[float, int]] = OrderedDict()

    def add(self, t_s: float, value: float) -> None:
        """Adds a measured value."""
        second = int(t_s // 1)
        total, count = self._sums.get(second, (0.0, 0))
        self._sums[second] = (total + value, count + 1)
        while len(self._sums) > SECONDS:
            self._sums.popitem(last=False)

    def values(self) -> list[float | None]:
        """Returns the means of the last seconds; None for a second without any value."""
        if not self._sums:
            return []
        last = max(self._sums)
        first = max(min(self._sums), last - SECONDS + 1)
        means = {second: total / count for second, (total, count) in self._sums.items()}
        return [means.get(second) for second in range(first, last + 1)]
