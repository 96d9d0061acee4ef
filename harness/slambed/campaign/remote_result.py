# SPDX-License-Identifier: Apache-2.0
"""The wait for what a Dask worker returns, on a cluster as on a host."""

import threading
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from typing import Any

from slambed.engines.result import InterruptedRunError

LOOK_EVERY_S = 0.02
FETCH_S = 60.0
"""A result that is there takes less on its way."""


class LostWorkerError(Exception):
    """Nobody returns the result any more."""

    def __init__(self, killed: bool = False) -> None:
        super().__init__()
        self.killed = killed
        """By their work: the scheduler gave up after several workers; else it is gone itself."""


def result_of(future: Any, stop: threading.Event, alive: Callable[[], bool] = lambda: True) -> Any:
    """What the task returns, or its own error.

    `alive`: whether somebody is still there who could return it. Raises InterruptedRunError when
    `stop` is set before, LostWorkerError when nobody is left; the task is canceled then.
    """
    from distributed import KilledWorker

    try:
        while True:
            if future.done():
                # Not while it runs: a wait that is given up cuts the connection to the scheduler,
                # and the next one would begin with a new one.
                with suppress(TimeoutError):
                    return future.result(timeout=FETCH_S)
            if stop.wait(LOOK_EVERY_S):
                raise InterruptedRunError
            if not alive():
                raise LostWorkerError
    except KilledWorker:
        raise LostWorkerError(killed=True) from None
    except (CancelledError, OSError):
        if future.status == "error":
            raise  # the run's own
        raise LostWorkerError from None
    finally:
        with suppress(Exception):
            future.cancel()
