# SPDX-License-Identifier: Apache-2.0
"""Executes virtual runs in parallel on this host, in worker processes.

A run is a subprocess, but reading its log and computing its metrics is Python work that threads
would serialize. Workers are forked from a preloaded server (`preload`), because the harness has
threads that may hold locks at that moment. A worker is reused: a new process copies each page of
the server that it writes to, which costs as much as all metrics. Workers share no lock that a
killed one could leave locked.
"""

import multiprocessing
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import ModuleType

import psutil

from slambed.campaign import server_folder
from slambed.campaign.executors import Played
from slambed.campaign.virtual_task import VirtualTask
from slambed.engines.result import InterruptedRunError
from slambed.engines.virtual import NICE
from slambed.errors import KilledError
from slambed.metrics.summary import Summary
from slambed.spec.run_spec import RunSpec

LOOK_EVERY_S = 0.2
DYING_S = 3.0
SIGNAL_S = 0.5
"""Time within which a campaign has noticed a signal that also ended one of its workers."""
MOST_RUNS = 100
"""Runs per worker process, which bounds memory leaks of libraries."""
CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(["slambed.campaign.preload"])
LOST = (EOFError, ConnectionError)
"""Errors of a pipe whose other end has gone."""
_starting = threading.Lock()


@contextmanager
def _without_main() -> Iterator[None]:
    """Hides the program that called the harness while a process starts. multiprocessing would
    import it there, and a script that calls `slambed.run` would start again in each worker."""
    with _starting:
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = main


def serve(pipe: Connection) -> None:
    """Main function of a worker process: executes tasks until the pipe closes."""
    # Only the harness handles Ctrl-C and a lost terminal.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    threading.Thread(target=_end_with_harness, daemon=True).start()
    os.nice(NICE)
    with suppress(*LOST):
        while True:
            task: VirtualTask = pipe.recv()
            try:
                pipe.send(task.execute())
            except LOST:
                raise
            except Exception as error:
                error.add_note(traceback.format_exc())
                pipe.send(error)


def _end_with_harness() -> None:
    """Ends this process, and with it the simulation, when the harness dies."""
    if (harness := multiprocessing.parent_process()) is not None:
        wait([harness.sentinel])
        os._exit(1)


class Worker:
    """A process that executes runs one after the other."""

    def __init__(self) -> None:
        self._pipe, theirs = CONTEXT.Pipe()
        with theirs:
            self._process = CONTEXT.Process(target=serve, args=(theirs,), daemon=True)
            with _without_main():
                self._process.start()
        self._runs = 0

    @property
    def is_fit(self) -> bool:
        """Whether it can take another run: it is alive and not too old."""
        return self._runs < MOST_RUNS and not self._pipe.poll()

    def execute(self, task: VirtualTask, stop: threading.Event) -> Summary | Exception:
        """Returns the result of a run. Raises InterruptedRunError soon after `stop` is set, and
        one of LOST if the process was killed; the worker cannot be used after that."""
        self._runs += 1
        self._pipe.send(task)
        while not self._pipe.poll(LOOK_EVERY_S):
            if stop.is_set():
                raise InterruptedRunError
        answer: Summary | Exception = self._pipe.recv()
        return answer

    def kill(self) -> None:
        """Kills the process and its simulation, and waits for the end of both: until then they may
        write into the folder of the run."""
        below: list[psutil.Process] = []
        if self._process.is_alive():
            with suppress(psutil.Error):
                worker = psutil.Process(self._process.pid)
                worker.suspend()  # It starts no simulation after this.
                below = worker.children(recursive=True)
        self._process.kill()
        self._process.join(DYING_S)
        for process in below:
            with suppress(psutil.Error):
                process.kill()
        psutil.wait_procs(below, DYING_S)
        self._pipe.close()


@dataclass
class ProcessExecutor:
    """Executes virtual runs in `jobs` processes on this host."""

    played: Played
    program: Path
    features: Path | None
    jobs: int
    _idle: list[Worker] = field(default_factory=list)

    def __post_init__(self) -> None:
        server_folder.sweep()
        server_folder.choose()

    def execute(self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1) -> Summary:
        """Executes the run in an idle or new worker."""
        sequence, played_s = self.played[spec.dataset]
        task = VirtualTask(
            spec,
            raw.resolve(),
            sequence.resolve(),
            played_s,
            self.program.resolve(),
            self.features.resolve() if self.features else None,
            sys.argv,
            attempt,
        )
        worker = self._worker()
        try:
            answer = worker.execute(task, stop)
        except LOST:
            worker.kill()
            # A signal to the whole process group ends the worker before the campaign handles it.
            if stop.wait(SIGNAL_S):
                raise InterruptedRunError from None
            raise KilledError(
                f"the process of run {spec.run_key} was killed; is there enough memory?"
            ) from None
        except BaseException:
            worker.kill()
            raise
        self._idle.append(worker)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _worker(self) -> Worker:
        with suppress(IndexError):
            while not (idle := self._idle.pop()).is_fit:
                idle.kill()
            return idle
        try:
            return Worker()
        except LOST:
            # The next run starts a new fork server.
            raise KilledError("the fork server of virtual runs was killed") from None

    def close(self) -> None:
        """Ends the idle workers."""
        while self._idle:
            self._idle.pop().kill()
