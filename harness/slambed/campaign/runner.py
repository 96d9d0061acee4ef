# SPDX-License-Identifier: Apache-2.0
"""Executes the missing runs of an experiment and commits each as it ends."""

import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.makers import Maker
from slambed.campaign.progress import Reporter
from slambed.engines.result import InterruptedRunError
from slambed.errors import SlambedError, no_space
from slambed.spec.matrix import RunSpec


@dataclass
class Verdict:
    """What a campaign came to."""

    done: int = 0
    valid: int = 0
    interrupted: bool = False


@dataclass
class Runner:
    """Runs RunSpecs into a result folder, as many at a time as the maker makes."""

    folder: ResultFolder
    ledger: Ledger
    maker: Maker
    _books: threading.Lock = field(default_factory=threading.Lock)
    """Ledger, reporter and verdict belong to one thread at a time."""

    def run(self, todo: list[RunSpec], reporter: Reporter) -> Verdict:
        """Starts all of `todo` in this order. Ctrl-C ends the current runs and returns; a node
        that cannot even start is an error that ends the campaign, because every other run would
        meet it."""
        verdict = Verdict()
        with stop_on_signal() as stop:
            try:
                if self.maker.jobs == 1:
                    for spec in todo:
                        self._one(spec, reporter, verdict, stop)
                else:
                    self._side_by_side(todo, reporter, verdict, stop)
            except InterruptedRunError:
                verdict.interrupted = True
            finally:
                self.maker.close()
        return verdict

    def _side_by_side(
        self, todo: list[RunSpec], reporter: Reporter, verdict: Verdict, stop: threading.Event
    ) -> None:
        with ThreadPoolExecutor(self.maker.jobs) as threads:
            futures = [
                threads.submit(self._one, spec, reporter, verdict, stop, wait_for_stop=True)
                for spec in todo
            ]
        failures = [error for future in futures if (error := future.exception()) is not None]
        # What went wrong first made the others stop.
        failures.sort(key=lambda error: isinstance(error, InterruptedRunError))
        if failures:
            raise failures[0]

    def _one(
        self,
        spec: RunSpec,
        reporter: Reporter,
        verdict: Verdict,
        stop: threading.Event,
        wait_for_stop: bool = False,
    ) -> None:
        if stop.is_set():
            raise InterruptedRunError
        key = spec.run_key
        with self._books:
            reporter.run_started(spec)
            self._tell("run_started", spec, repetition=spec.repetition)
        try:
            raw = self.folder.new_raw(key)
            summary = self.maker.make(spec, raw, stop)
            self.folder.commit(key, raw)
        except InterruptedRunError:
            with self._books:
                self._tell("run_interrupted", spec)
            raise
        except Exception as error:
            if wait_for_stop:
                stop.set()
            if self.folder.is_full():
                # Whatever failed, failed for this; not even the ledger could be told.
                raise no_space(self.folder.path) from error
            if isinstance(error, SlambedError):
                with self._books:
                    self._tell("run_refused", spec, error=str(error))
            raise
        with self._books:
            self._tell(
                "run_finished",
                spec,
                repetition=spec.repetition,
                outcome=summary.get("outcome"),
                valid=summary.get("valid"),
                invalid_reason=summary.get("invalid_reason"),
            )
            verdict.done += 1
            verdict.valid += summary.get("valid") is True
            reporter.run_ended(spec, verdict_of(summary))

    def _tell(self, event: str, spec: RunSpec, **fields: Any) -> None:
        self.ledger.append(event, run_key=spec.run_key, cell=spec.cell, **fields)


def verdict_of(summary: dict[str, Any]) -> str:
    """One phrase about a finished run."""
    if summary.get("valid") is True:
        tracked, total = summary.get("frames_tracked"), summary.get("frames_total")
        return f"completed, {tracked}/{total} frames tracked"
    return f"{summary.get('outcome')}, not valid: {summary.get('invalid_reason')}"


@contextmanager
def stop_on_signal() -> Iterator[threading.Event]:
    """SIGINT and SIGTERM set the event; a second SIGINT is a KeyboardInterrupt."""
    stop = threading.Event()

    def handle(number: int, frame: object) -> None:
        if stop.is_set() and number == signal.SIGINT:
            raise KeyboardInterrupt
        stop.set()

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
