# SPDX-License-Identifier: Apache-2.0
"""Executes virtual runs side by side on this host, each in a process of its own.

A run is a subprocess anyway, but reading its log and computing its metrics takes Python as well:
threads alone would wait for each other. The processes are forked from a server that has everything
ready (`preload`; pebble over multiprocessing's forkserver), so one costs milliseconds; nothing is
shared between them that a killed one could leave locked.
"""

import multiprocessing
import os
import sys
import threading
from concurrent.futures import CancelledError, InvalidStateError
from concurrent.futures import TimeoutError as FutureTimeoutError
from dataclasses import dataclass
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

from pebble import ProcessExpired, concurrent

from slambed.campaign import server_folder
from slambed.campaign.executors import Played
from slambed.campaign.virtual_task import VirtualTask
from slambed.engines.result import InterruptedRunError
from slambed.engines.virtual import NICE
from slambed.errors import KilledError
from slambed.metrics.summary import Summary
from slambed.spec.run_spec import RunSpec

LOOK_EVERY_S = 0.1
CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(["slambed.campaign.preload"])


def _execute(task: VirtualTask) -> Summary:
    threading.Thread(target=_end_with_harness, daemon=True).start()
    os.nice(NICE)
    return task.execute()


_in_a_process: Any = concurrent.process
# Pebble's types call the option mp_context; its code reads this one, and forks the harness without.
execute_apart = _in_a_process(context=CONTEXT)(_execute)
"""Executes the run in a new process; the future gives its summary or raises its error."""


def _end_with_harness() -> None:
    """However the harness dies, its run ends too: the kernel ends the simulation with us."""
    if (harness := multiprocessing.parent_process()) is not None:
        wait([harness.sentinel])
        os._exit(1)


def thread_failed(failure: threading.ExceptHookArgs) -> None:
    """A thread of pebble's finds its future cancelled at the very moment at which its process ends:
    when a campaign stops nobody waits for that result, so there is nothing to tell."""
    if failure.exc_type is not InvalidStateError:
        threading.__excepthook__(failure)


@dataclass
class ProcessExecutor:
    """Executes virtual runs in `jobs` processes of this host."""

    played: Played
    program: Path
    features: Path | None
    jobs: int

    def __post_init__(self) -> None:
        threading.excepthook = thread_failed
        server_folder.sweep()
        server_folder.choose()

    def execute(self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1) -> Summary:
        """Waits for a process of its own."""
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
        try:
            future = execute_apart(task)
        except (ConnectionError, EOFError):
            # The next run has a new one.
            raise KilledError("the fork server of virtual runs was killed") from None
        try:
            while True:
                try:
                    summary: Summary = future.result(LOOK_EVERY_S)
                    return summary
                except FutureTimeoutError:
                    if stop.is_set():
                        raise InterruptedRunError from None
        except (ProcessExpired, CancelledError):
            raise KilledError(
                f"the process of run {spec.run_key} was killed; is there enough memory?"
            ) from None
        finally:
            future.cancel()

    def close(self) -> None:
        """Processes end with their runs; threads of pebble's may still be about to see that."""
