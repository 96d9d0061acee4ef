# SPDX-License-Identifier: Apache-2.0
"""Waits that end: what does not come is named, instead of a test that never ends."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")
LIMIT_S = 60.0
"""Many times what a busy host needs for what tests wait for, and far below the limit of a test."""


def until(
    condition: Callable[[], T], what: str, limit_s: float = LIMIT_S, every_s: float = 0.01
) -> T:
    """What `condition` says once that is true; AssertionError naming `what` did not come."""
    deadline = time.monotonic() + limit_s
    while not (value := condition()):
        assert time.monotonic() < deadline, f"did not come within {limit_s:g} s: {what}"
        time.sleep(every_s)
    return value


@contextmanager
def in_background(
    work: Callable[[], object], over: threading.Event | None = None, limit_s: float = LIMIT_S
) -> Iterator[None]:
    """Does `work` in a thread meanwhile, and raises here what went wrong there. `over` is set at
    the end: what `work` takes as the sign to end."""
    errors: list[BaseException] = []

    def run() -> None:
        try:
            work()
        except BaseException as error:
            errors.append(error)

    # No process waits for a daemon when it ends.
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
