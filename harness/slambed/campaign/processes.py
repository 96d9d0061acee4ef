# SPDX-License-Identifier: Apache-2.0
"""Executes virtual runs side by side on this host, each in a process of its own while it lasts.

A run is a subprocess anyway, but reading its log and computing its metrics takes Python as well:
threads alone would wait for each other. The processes are forked from a server that has everything
ready (`preload`), because the harness has threads, which may hold any lock at that moment. One
that has ended a run takes the next: a fresh one pays for each page of the server's that it touches,
as much as all metrics take. Nothing is shared that a killed one could leave locked.
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
MOST_RUNS = 100
"""Of one process: whatever a library keeps of each, it goes then."""
CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(["slambed.campaign.preload"])
LOST = (EOFError, ConnectionError)
"""What a pipe says whose other end is gone."""
_starting = threading.Lock()


@contextmanager
def _without_main() -> Iterator[None]:
    """For the start of a process: it would import the program that calls us, as multiprocessing
    does, and a program that calls `slambed.run` would begin again in there. It needs none of it."""
    with _starting:
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = main


def serve(pipe: Connection) -> None:
    """In a process of its own: executes what comes, until nothing more does."""
    # Ctrl-C and a lost terminal are for the harness.
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
    """However the harness dies, its run ends too: the kernel ends the simulation with us."""
    if (harness := multiprocessing.parent_process()) is not None:
        wait([harness.sentinel])
        os._exit(1)


class Worker:
    """A process that executes one run after the other."""

    def __init__(self) -> None:
        self._pipe, theirs = CONTEXT.Pipe()
        with theirs:
            self._process = CONTEXT.Process(target=serve, args=(theirs,), daemon=True)
            with _without_main():
                self._process.start()
        self._runs = 0

    @property
    def is_fit(self) -> bool:
        """Whether it shall execute one more: nobody killed it, and it is not old."""
        return self._runs < MOST_RUNS and not self._pipe.poll()

    def execute(self, task: VirtualTask, stop: threading.Event) -> Summary | Exception:
        """What became of a run. InterruptedRunError soon after `stop` is set, one of LOST where
        the process was killed: it is of no use any more then."""
        self._runs += 1
        self._pipe.send(task)
        while not self._pipe.poll(LOOK_EVERY_S):
            if stop.is_set():
                raise InterruptedRunError
        answer: Summary | Exception = self._pipe.recv()
        return answer

    def kill(self) -> None:
        """With the simulation that it may have in hand."""
        self._process.kill()
        self._process.join(DYING_S)
        self._pipe.close()


@dataclass
class ProcessExecutor:
    """Executes virtual runs in `jobs` processes of this host."""

    played: Played
    program: Path
    features: Path | None
    jobs: int
    _idle: list[Worker] = field(default_factory=list)

    def __post_init__(self) -> None:
        server_folder.sweep()
        server_folder.choose()

    def execute(self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1) -> Summary:
        """Waits for a process that has nothing else in hand."""
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
            # The next run has a new one.
            raise KilledError("the fork server of virtual runs was killed") from None

    def close(self) -> None:
        """Ends the processes, which have no run in hand any more."""
        while self._idle:
            self._idle.pop().kill()
