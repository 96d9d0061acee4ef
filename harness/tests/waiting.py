# SPDX-License-Identifier: Apache-2.0
"""Waits with a timeout: a missing event fails the test instead of hanging it."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")
LIMIT_S = 60.0
"""Many times what a busy host needs, and far below the time limit of a test."""


def until(
    condition: Callable[[], T], what: str, limit_s: float = LIMIT_S, every_s: float = 0.01
) -> T:
    """Returns the value of `condition` once it is true; after the timeout raises AssertionError
    that `what` did not come."""
    deadline = time.monotonic() + limit_s
    while not (value := condition()):
        assert time.monotonic() < deadline, f"did not come within {limit_s:g} s: {what}"
        time.sleep(every_s)
    return value


@contextmanager
def in_background(
    work: Callable[[], object], over: threading.Event | None = None, limit_s: float = LIMIT_S
) -> Iterator[None]:
    """Runs `work` in a thread during the block and raises its errors here. `over` is set at the
    end to stop `work`."""
    errors: list[BaseException] = []

    def run() -> None:
        try:
            work()
        except BaseException as error:
            errors.append(error)

    # A daemon thread does not block the exit of the process.
    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield
    except BaseException as error:
        for beside_it in errors:
            error.add_note(f"and beside it: {type(beside_it).__name__}: {beside_it}")
        raise
    finally:
        if over is not None:
            over.set()
        thread.join(limit_s)
    assert not thread.is_alive(), f"{work} has not ended {limit_s:g} s later"
    if errors:
        raise errors[0]
