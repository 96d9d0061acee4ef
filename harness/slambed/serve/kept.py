# SPDX-License-Identifier: Apache-2.0
"""Caches what was computed for pages; results may grow while they are viewed."""

import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

REST = 4.0
"""A stale value is shown for this many times its computing time: with thousands of runs that takes
seconds, and a campaign adds a run every few seconds."""

T = TypeVar("T")


@dataclass
class _Entry(Generic[T]):
    stamp: Hashable
    value: T
    made_s: float
    took_s: float


@dataclass
class PageCache(Generic[T]):
    """The last used values, each with the stamp of its files."""

    most: int
    now: Callable[[], float] = time.monotonic
    _entries: OrderedDict[Hashable, _Entry[T]] = field(default_factory=OrderedDict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def get(self, key: Hashable, stamp: Hashable, make: Callable[[], T]) -> tuple[Hashable, T]:
        """Returns a value with its stamp. One thread at a time computes."""
        with self._lock:
            entry = self._entries.get(key)
            if entry is None or (stamp != entry.stamp and self._is_rested(entry)):
                begin_s = self.now()
                value = make()
                end_s = self.now()
                entry = self._entries[key] = _Entry(stamp, value, end_s, end_s - begin_s)
            self._entries.move_to_end(key)
            while len(self._entries) > self.most:
                self._entries.popitem(last=False)
            return entry.stamp, entry.value

    def _is_rested(self, entry: _Entry[T]) -> bool:
        return self.now() - entry.made_s >= REST * entry.took_s


def stamp_of(*paths: Path) -> tuple[tuple[int, int] | None, ...]:
    """Returns a stamp that changes when one of these files or folders does."""
    return tuple(_status(path) for path in paths)


def _status(path: Path) -> tuple[int, int] | None:
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size
