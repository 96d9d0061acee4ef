# SPDX-License-Identifier: Apache-2.0
"""Waits for the end of a child without polling."""

import os
import select
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def end_of(child: subprocess.Popen[bytes]) -> Iterator[Callable[[float], int | None]]:
    """Yields a function that waits up to a number of seconds and returns the exit code, None before
    the end.

    It uses a pidfd (Linux 5.3), which becomes readable when the process ends; `Popen.wait` with a
    timeout polls many times per second instead.
    """
    try:
        handle = os.pidfd_open(child.pid)
    except OSError:  # an older kernel, or no permission
        yield lambda timeout_s: _wait(child, timeout_s)
        return
    ended = select.poll()
    ended.register(handle, select.POLLIN)

    def wait(timeout_s: float) -> int | None:
        ended.poll(1e3 * timeout_s)
        return child.poll()

    try:
        yield wait
    finally:
        os.close(handle)


def _wait(child: subprocess.Popen[bytes], timeout_s: float) -> int | None:
    try:
        return child.wait(timeout_s)
    except subprocess.TimeoutExpired:
        return None
