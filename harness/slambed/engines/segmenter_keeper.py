# SPDX-License-Identifier: Apache-2.0
"""Restarts the segmenter of a live run when it dies: one crash must not cost the rest of the run
its masks (docs/explanation/masks.md)."""

import time
from collections.abc import Callable
from typing import Protocol

from slambed.engines.base import SegmenterSidecar
from slambed.errors import SlambedError

RESTART_PERIOD_S = 3.0
"""Minimum time between starts: a segmenter that dies at once must not keep a core busy with
loading."""


class Note(Protocol):
    """Logs an event of the harness."""

    def __call__(self, kind: str, **fields: object) -> None: ...


class SegmenterKeeper:
    """Holds the current segmenter; the edge reconnects for every picture by itself."""

    def __init__(self, start: Callable[[], SegmenterSidecar]) -> None:
        """`start`: starts one next to the edge; raises SlambedError if that fails."""
        self._start = start
        self._started_s = time.monotonic()
        self._process: SegmenterSidecar | None = start()
        self._reported_ready = True
        self._cpu_s: float | None = 0.0
        self.restarts = 0
        """Number of restarts after the segmenter had died."""

    def await_ready(self, stopped: Callable[[], bool]) -> None:
        """Waits for the first segmenter, before the run begins."""
        assert self._process is not None
        self._process.await_ready(stopped)

    def act(self, note: Note, edge_lives: bool) -> None:
        """Restarts it if due, without waiting. Without a running edge there is nothing to
        segment."""
        if self._process is not None and (how := self._process.ended()) is not None:
            note("segmenter_ended", how=how)
            self._close()
        if self._process is not None and not self._reported_ready and self._process.is_ready():
            note("segmenter_restarted", restarts=self.restarts)
            self._reported_ready = True
        late_enough = time.monotonic() - self._started_s >= RESTART_PERIOD_S
        if self._process is None and edge_lives and late_enough:
            self._started_s = time.monotonic()
            self.restarts += 1
            try:
                self._process, self._reported_ready = self._start(), False
            except (SlambedError, OSError) as error:
                note("segmenter_not_started", reason=str(error))

    def close(self) -> float | None:
        """Returns the CPU seconds of all segmenters; None if one died before it could report
        them."""
        if self._process is not None:
            self._close()
        return self._cpu_s

    def _close(self) -> None:
        assert self._process is not None
        took_s, self._process = self._process.close(), None
        self._cpu_s = None if took_s is None or self._cpu_s is None else self._cpu_s + took_s
