# SPDX-License-Identifier: Apache-2.0
"""The runs that a campaign still has to execute, shared by its worker threads."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from slambed.spec.run_spec import RunSpec

LOOK_EVERY_S = 0.1


@dataclass
class Item:
    """A run and the history of its attempts in this campaign."""

    spec: RunSpec
    retries: int = 0
    """Attempts that followed an invalid one."""
    failures: int = 0
    """Attempts without a result."""
    not_before_s: float = 0.0
    """Earliest start, on time.monotonic()."""


@dataclass
class Backlog:
    """A FIFO queue; a run that is put back goes to the end and may also have to wait."""

    specs: Iterable[RunSpec]
    _waiting: deque[Item] = field(init=False)
    _in_hand: int = 0
    _changed: threading.Condition = field(default_factory=threading.Condition)

    def __post_init__(self) -> None:
        self._waiting = deque(Item(spec) for spec in self.specs)

    def __iter__(self) -> Iterator[Item]:
        """Iterates over the waiting runs; to be used before any is taken."""
        return iter(self._waiting)

    def take(
        self, stop: threading.Event, claim: Callable[[RunSpec], bool] = lambda spec: True
    ) -> Item | None:
        """Waits for and returns the next run that `claim` accepts; None when all are done or
        `stop` is set."""
        with self._changed:
            while not stop.is_set():
                now_s = time.monotonic()
                for item in self._waiting:
                    if item.not_before_s <= now_s and claim(item.spec):
                        self._waiting.remove(item)
                        self._in_hand += 1
                        return item
                # A run in another thread may still be put back.
                if not self._waiting and not self._in_hand:
                    return None
                self._changed.wait(LOOK_EVERY_S)
        return None

    def done(self) -> None:
        """Marks a taken run as finished."""
        with self._changed:
            self._in_hand -= 1
            self._changed.notify_all()

    def put_back(self, item: Item, pause_s: float = 0.0) -> None:
        """Puts a taken run back for another attempt."""
        with self._changed:
            item.not_before_s = time.monotonic() + pause_s
            self._waiting.append(item)
            self._in_hand -= 1
            self._changed.notify_all()
