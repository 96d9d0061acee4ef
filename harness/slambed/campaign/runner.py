# SPDX-License-Identifier: Apache-2.0
"""Executes the missing runs of an experiment and commits each one when it ends."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from slambed.campaign.backlog import Backlog, Item
from slambed.campaign.executors import Executor
from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.manifest import add_plans
from slambed.campaign.progress import Reporter
from slambed.campaign.raw_folder import must_be_prepared
from slambed.campaign.store import LOGS
from slambed.engines.result import InterruptedRunError
from slambed.errors import KilledError, PassingError, SlambedError, no_space
from slambed.failures import refused_write
from slambed.metrics.summary import Summary
from slambed.process.hangup import interrupt_once
from slambed.process.standard_streams import ERROR, replace_gone
from slambed.spec.run_spec import RunSpec

PAUSES_S = (1.0, 10.0, 60.0)
"""Pauses before retries of a run that failed because of its environment."""
MOST_DEATHS = 20
"""Maximum attempts of a run whose process is killed: a retry is cheap for a short run, and a
kill says little about the run."""
DEFAULT_RETRIES = 2
"""Retries of an invalid run."""
MOST_GIVEN_UP = 5
"""After this many runs in a row without a result, the environment counts as broken."""


@dataclass
class CampaignOutcome:
    """The outcome of a campaign."""

    done: int = 0
    valid: int = 0
    not_completed: int = 0
    """Number of valid runs that the system did not complete."""
    interrupted: bool = False
    given_up: dict[str, str] = field(default_factory=dict)
    """Run key -> why there is no result."""
    folder: Path | None = None
    """Folder of the results."""


class Places(Protocol):
    """Placement of runs, for executors that assign runs to hosts. Called before and after each run,
    from several threads."""

    def claim(self, spec: RunSpec) -> bool:
        """Returns whether the run may start now; if so, reserves its place until `release`."""

    def release(self, spec: RunSpec) -> None:
        """Releases the place: the run has ended or will not start."""

    def host_of(self, spec: RunSpec) -> str | None:
        """Returns the host of a claimed run; None if there is only one."""


class AnyPlace:
    """Placement without any restriction."""

    def claim(self, spec: RunSpec) -> bool:
        """Returns True."""
        return True

    def release(self, spec: RunSpec) -> None:
        """Does nothing."""

    def host_of(self, spec: RunSpec) -> None:
        """Returns None."""
        return None


@dataclass
class Runner:
    """Executes RunSpecs into a result folder, as many in parallel as the executor allows."""

    folder: ResultFolder
    ledger: Ledger
    executor: Executor
    retries: int = DEFAULT_RETRIES
    """Retries of an invalid run in this campaign."""
    forced: frozenset[str] = frozenset()
    """Keys of runs that are executed although they exist. A new valid result replaces the old
    one, which is kept as an earlier attempt."""
    keep_going: bool = False
    """Never ends the campaign because of runs without a result."""
    plans: dict[str, dict[str, str]] = field(default_factory=dict)
    """Paper -> digests of its registered plan at the start of this campaign, for the manifests."""
    may_start: Callable[[], bool] = lambda: True
    """Whether another run may be started; runs under way end as usual."""
    there: int = 0
    """Runs that were asked for and are there from earlier campaigns: the environment worked."""
    sequences: dict[str, Path] = field(default_factory=dict)
    """Sequence id -> prepared folder that runs read on this machine; checked before each run."""
    pauses_s: tuple[float, ...] = PAUSES_S
    places: Places = field(default_factory=AnyPlace)
    verdict: CampaignOutcome = field(default_factory=CampaignOutcome)
    """What became of the campaign so far."""
    _given_up_in_a_row: int = 0
    _books: threading.Lock = field(default_factory=threading.Lock)
    """Guards ledger, reporter and verdict."""

    def run(self, todo: list[RunSpec], reporter: Reporter) -> CampaignOutcome:
        """Executes `todo` in this order. Ctrl-C ends the current runs and returns.

        A run that fails because of its environment is retried later and finally given up, and the
        campaign continues. It only ends with an error if a failure affects all runs: nothing ever
        succeeded, several runs in a row were given up, or the disk is full.
        """
        backlog = Backlog(todo)
        for item in backlog:
            # A stored invalid attempt counts as the first one.
            item.retries = int(self.folder.state(item.spec.run_key) == "invalid")
        with stop_on_signal() as stop:
            try:
                if self.executor.jobs == 1:
                    # Nodes end with the thread that started them, so use the main thread.
                    self._work(backlog, reporter, stop)
                else:
                    with ThreadPoolExecutor(self.executor.jobs) as threads:
                        work = [
                            threads.submit(self._work, backlog, reporter, stop)
                            for _ in range(min(self.executor.jobs, len(todo)))
                        ]
                    if errors := [e for each in work if (e := each.exception()) is not None]:
                        # The first real error made the other threads stop.
                        raise min(errors, key=lambda e: isinstance(e, InterruptedRunError))
            except InterruptedRunError:
                pass
            except KeyboardInterrupt:
                self.verdict.interrupted = True
                raise
            self.verdict.interrupted = stop.is_set()
        return self.verdict

    def _work(self, backlog: Backlog, reporter: Reporter, stop: threading.Event) -> None:
        while (item := self._take(backlog, stop)) is not None:
            try:
                pause_s = self._try(item, reporter, stop)
            except BaseException:
                stop.set()  # ends the other threads
                raise
            finally:
                self.places.release(item.spec)
            if pause_s is None:
                backlog.done()
            else:
                backlog.put_back(item, pause_s)

    def _take(self, backlog: Backlog, stop: threading.Event) -> Item | None:
        if not self.may_start():
            return None
        try:
            return backlog.take(stop, self.places.claim)
        except BaseException:
            stop.set()  # no host is left for any thread
            raise

    def _try(self, item: Item, reporter: Reporter, stop: threading.Event) -> float | None:
        """Executes one attempt; returns the pause before the next one, None if there will be
        none."""
        spec = item.spec
        with self._books:
            reporter.run_started(spec)
            self._log("run_started", spec, repetition=spec.repetition)
        try:
            if spec.dataset in self.sequences:
                must_be_prepared(spec, self.sequences[spec.dataset])
            raw = self.folder.new_raw(spec.run_key)
            attempt = self.folder.store.attempts_of(spec.run_key) + 1
            summary = self.executor.execute(spec, raw, stop, attempt)
            add_plans(raw, self.plans)
            replace = spec.run_key in self.forced and summary.valid
            self.folder.commit(spec.run_key, raw, replace)
        except InterruptedRunError:
            with self._books:
                self._log("run_interrupted", spec, repetition=spec.repetition)
            raise
        except Exception as error:
            if self.folder.is_full():
                # The full disk explains any error, and not even the ledger can be written.
                raise no_space(self.folder.path) from error
            if (refused := refused_write(error)) is not None:
                # The next run would fail on the same disk.
                raise refused from error
            with self._books:
                return self._failed(item, error, reporter)
        with self._books:
            self._log(
                "run_finished",
                spec,
                repetition=spec.repetition,
                outcome=summary.get("outcome"),
                outcome_reason=summary.get("outcome_reason"),
                valid=summary.get("valid"),
                invalid_reason=summary.get("invalid_reason"),
            )
            self._given_up_in_a_row = 0
            if not summary.valid and item.retries < self.retries:
                item.retries += 1
                line = f"{verdict_of(summary)}; it is executed again"
                reporter.run_failed(spec, line, last=False)
                return 0.0
            self.verdict.done += 1
            self.verdict.valid += summary.valid
            self.verdict.not_completed += summary.valid and not summary.completed
            line = verdict_of(summary)
            if not summary.completed:
                line += f"; logs: {self.folder.runs / spec.run_key / LOGS}"
            host = self.places.host_of(spec)
            reporter.run_ended(spec, line + (f"; host {host}" if host else ""))
        return None

    def _failed(self, item: Item, error: Exception, reporter: Reporter) -> float | None:
        """Returns the pause before the next attempt, like `_try`."""
        item.failures += 1
        line = str(error) if isinstance(error, SlambedError) else f"{type(error).__name__}: {error}"
        self._log("run_failed", item.spec, error=line)
        if isinstance(error, KilledError) and item.failures < MOST_DEATHS:
            reporter.run_failed(item.spec, f"{line}; it is tried again", last=False)
            return 0.0
        if isinstance(error, PassingError) and item.failures <= len(self.pauses_s):
            reporter.run_failed(item.spec, f"{line}; it is tried again", last=False)
            return self.pauses_s[item.failures - 1]
        self._given_up_in_a_row += 1
        ever = self.there or self.verdict.done
        hopeless = not ever or self._given_up_in_a_row >= MOST_GIVEN_UP
        if hopeless and not self.keep_going:
            raise error
        self.verdict.given_up[item.spec.run_key] = line
        reporter.run_failed(item.spec, line, last=True)
        return None

    def _log(self, event: str, spec: RunSpec, **fields: Any) -> None:
        if (host := self.places.host_of(spec)) is not None:
            fields["host"] = host
        self.ledger.append(event, run_key=spec.run_key, cell=spec.cell, **fields)


def verdict_of(summary: Summary) -> str:
    """Returns a phrase about a finished run."""
    phrase = summary.outcome.replace("_", " ")
    if summary.get("outcome_reason"):
        phrase += f": {summary['outcome_reason']}"
    if summary.get("frames_total"):
        phrase += f", {summary.get('frames_tracked')}/{summary['frames_total']} frames tracked"
    if not summary.valid:
        phrase += f"; invalid: {summary.get('invalid_reason')}"
    return phrase


STOPPING = (
    b"\nstopping: ending the runs under way and removing what they made (some seconds); "
    b"Ctrl-C once more ends at once\n"
)


ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Ctrl-C, a request to terminate, and a lost terminal or connection."""


@contextmanager
def stop_on_signal() -> Iterator[threading.Event]:
    """SIGINT, SIGTERM and SIGHUP set the event; a second SIGINT raises KeyboardInterrupt. An
    ignored SIGHUP (nohup) stays ignored. A handler `interrupt_once` is not restored after its one
    signal. Only the main thread of a program hears signals."""
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    came: set[int] = set()

    def handle(number: int, frame: object) -> None:
        came.add(number)
        if stop.is_set() and number == signal.SIGINT:
            raise KeyboardInterrupt
        first = not stop.is_set()
        stop.set()
        replace_gone()
        if first:
            # Immediately; a signal handler may write but not print.
            os.write(ERROR, STOPPING)

    heard = [n for n in ENDING if n != signal.SIGHUP or signal.getsignal(n) != signal.SIG_IGN]
    before = {number: signal.signal(number, handle) for number in heard}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            spent = handler is interrupt_once and number in came
            signal.signal(number, signal.SIG_IGN if spent else handler)
