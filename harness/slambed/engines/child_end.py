# SPDX-License-Identifier: Apache-2.0
"""Waiting for the end of a child without looking again and again whether it has come."""

import os
import select
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def end_of(child: subprocess.Popen[bytes]) -> Iterator[Callable[[float], int | None]]:
    """A function that waits so many seconds at most; it returns the exit code, None before the end.

    By a pidfd (Linux 5.3), which the kernel makes readable with the end; `Popen.wait` with a
    timeout wakes up a hundred times per second instead.
    """
    try:
        handle = os.pidfd_open(child.pid)
    except OSError:  # an older kernel, or one that does not let us
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
