# SPDX-License-Identifier: Apache-2.0
"""Times of faults: random, but early enough for a fast host."""

import random

WITHIN_ENTRIES = 2
"""An undisturbed run has two ledger entries: its start and its end."""


class Instants:
    """The next fault is due at a random time after the last one, or at the latest at a random
    number of run entries in the ledger. The number of faults therefore depends on the campaign's
    progress and not on its speed."""

    def __init__(self, seed: str, every_s: float) -> None:
        self._every_s = every_s
        self._times = random.Random(f"times/{seed}")
        self._entries = random.Random(f"entries/{seed}")
        self._next_s: float | None = None
        self._before = 0
        # Not at the very first entry, which marks the start of a run: nothing is active yet.
        self._latest = 1
        self._draw_entry()

    def _draw_entry(self) -> None:
        self._latest += self._entries.randint(1, WITHIN_ENTRIES)

    def call(self, entries: int) -> None:
        """A further call of the command begins, with this number of entries."""
        self._before, self._next_s = entries, None

    def executes(self, now_s: float) -> None:
        """The call executes runs, or may meet faults before that."""
        if self._next_s is None:
            self._draw_time(now_s)

    def _draw_time(self, now_s: float) -> None:
        self._next_s = now_s + self._times.expovariate(1 / self._every_s)

    def due(self, now_s: float, entries: int) -> bool:
        """Returns whether the next fault is due; a due entry stays due until a fault has hit."""
        by_entry = entries > self._before and entries >= self._latest
        return by_entry or (self._next_s is not None and now_s >= self._next_s)

    def drawn(self, now_s: float, struck: bool) -> None:
        """A fault was drawn; it may have had no target."""
        self._draw_time(now_s)
        if struck:
            self._draw_entry()
