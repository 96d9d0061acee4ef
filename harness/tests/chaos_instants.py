# SPDX-License-Identifier: Apache-2.0
"""When faults come: at random instants, but not so late that a fast host is done before."""

import random

WITHIN_ENTRIES = 2
"""A run that nothing happens to has two in the ledger: when it begins and when it has ended."""


class Instants:
    """The next fault is due at a random instant after the last one, and at the latest once the
    ledger has so many entries of runs. How many faults a campaign meets hangs on how far it comes
    then, and not on how fast."""

    def __init__(self, seed: str, every_s: float) -> None:
        self._every_s = every_s
        self._times = random.Random(f"times/{seed}")
        self._entries = random.Random(f"entries/{seed}")
        self._next_s: float | None = None
        self._before = 0
        # Not the very first, which says that a run begins: nothing is at work yet.
        self._latest = 1
        self._draw_entry()

    def _draw_entry(self) -> None:
        self._latest += self._entries.randint(1, WITHIN_ENTRIES)

    def call(self, entries: int) -> None:
        """A further call of the command begins, which finds so many entries."""
        self._before, self._next_s = entries, None

    def executes(self, now_s: float) -> None:
        """The call executes runs, or shall meet faults before it does."""
        if self._next_s is None:
            self._draw_time(now_s)

    def _draw_time(self, now_s: float) -> None:
        self._next_s = now_s + self._times.expovariate(1 / self._every_s)

    def due(self, now_s: float, entries: int) -> bool:
        """Whether the next fault is; it stays so by its entry until something is struck."""
        by_entry = entries > self._before and entries >= self._latest
        return by_entry or (self._next_s is not None and now_s >= self._next_s)

    def drawn(self, now_s: float, struck: bool) -> None:
        """A fault was drawn; it may have met nothing."""
        self._draw_time(now_s)
        if struck:
            self._draw_entry()
