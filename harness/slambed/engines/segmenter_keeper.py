# SPDX-License-Identifier: Apache-2.0
"""Starts the segmenter of a live run again where it died: one crash must not cost the rest of the
run its masks (docs/explanation/masks.md)."""

import time
from collections.abc import Callable
from typing import Protocol

from slambed.engines.base import SegmenterSidecar
from slambed.errors import SlambedError

RESTART_PERIOD_S = 3.0
"""No sooner after the last start: what dies at once must not keep a core busy with loading."""


class Note(Protocol):
    """Writes an event of the harness."""

    def __call__(self, kind: str, **fields: object) -> None: ...


class SegmenterKeeper:
    """Holds the segmenter that there is; the edge calls again for every picture by itself."""

    def __init__(self, start: Callable[[], SegmenterSidecar]) -> None:
        """`start`: beside the edge; raises SlambedError where there is no way."""
        self._start = start
        self._started_s = time.monotonic()
        self._process: SegmenterSidecar | None = start()
        self._reported_ready = True
        self._cpu_s: float | None = 0.0
        self.restarts = 0
        """How often one that had died was started again."""

    def await_ready(self, stopped: Callable[[], bool]) -> None:
        """Of the first, before the run begins."""
        assert self._process is not None
        self._process.await_ready(stopped)

    def act(self, note: Note, edge_lives: bool) -> None:
        """What is due, without waiting for it. Without an edge there is nobody to segment for."""
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
        """CPU seconds of all of them; None where one did not live to report it."""
        if self._process is not None:
            self._close()
        return self._cpu_s

    def _close(self) -> None:
        assert self._process is not None
        took_s, self._process = self._process.close(), None
        self._cpu_s = None if took_s is None or self._cpu_s is None else self._cpu_s + took_s
