# SPDX-License-Identifier: Apache-2.0
"""Waits for the result of a Dask worker, on a cluster or on a host, and names it in errors."""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from typing import Any

from slambed.engines.result import InterruptedRunError
from slambed.errors import PassingError, SlambedError
from slambed.failures import refused_write

LOOK_EVERY_S = 0.02
FETCH_S = 60.0
"""Fetching an available result takes less time than this."""


class LostWorkerError(Exception):
    """No worker can return the result any more."""

    def __init__(self, killed: bool = False) -> None:
        super().__init__()
        self.killed = killed
        """True if the scheduler gave up after several workers died; false if the scheduler
        itself is gone."""


def result_of(future: Any, stop: threading.Event, alive: Callable[[], bool] = lambda: True) -> Any:
    """Returns the task's result, or raises its error.

    `alive` returns whether the worker is still there. Raises InterruptedRunError when `stop` is
    set, LostWorkerError when no worker is left; the task is then canceled.
    """
    from distributed import KilledWorker

    try:
        while True:
            if future.done():
                # Not while the task runs: a wait that times out closes the connection to the
                # scheduler, and the next one would have to reconnect.
                try:
                    return future.result(timeout=FETCH_S)
                except TimeoutError:
                    if future.status == "error":
                        raise  # the run's own; otherwise it was not fetched in time
            if stop.wait(LOOK_EVERY_S):
                raise InterruptedRunError
            if not alive():
                raise LostWorkerError
    except SlambedError as error:
        # What is behind it, such as a full disk, is not of this machine.
        error.__cause__ = error.__context__ = None
        raise
    except KilledWorker:
        raise LostWorkerError(killed=True) from None
    except (CancelledError, OSError):
        if future.status == "error":
            raise  # error of the run itself
        raise LostWorkerError from None
    finally:
        with suppress(Exception):
            future.cancel()


@contextmanager
def of_machine(name: str) -> Iterator[None]:
    """Names this machine in errors that go back to the campaign.

    Raises PassingError for a file that cannot be read or written, such as on a full disk: only this
    machine has it, so the run may be made on another one, and the campaign goes on.
    """
    try:
        yield
    except SlambedError as error:
        error.args = (f"{name}: {error}",)
        raise
    except OSError as error:
        raise PassingError(f"{name}: {refused_write(error) or error}") from error
