# SPDX-License-Identifier: Apache-2.0
"""SIGHUP, the signal of a lost terminal or connection, and SIGTERM: either may come twice."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


def interrupt_once(number: int, frame: FrameType | None) -> None:
    """Handler: raises KeyboardInterrupt as Ctrl-C does, and ignores the signal from then on.

    The shell and the kernel both report a lost terminal, and sudo passes signals on. The second
    signal may come while the first interruption removes what a command made, and would leave the
    rest of it behind.
    """
    signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


@contextmanager
def interrupted_by_sigterm() -> Iterator[None]:
    """SIGTERM raises KeyboardInterrupt in the block, so that `kill` leaves nothing behind, such as
    jobs that wait in a queue. A program that handles it keeps its handler."""
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, interrupt_once)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
