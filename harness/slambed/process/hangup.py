# SPDX-License-Identifier: Apache-2.0
"""SIGHUP, the signal of a lost terminal or connection, which may come twice for one loss."""

import signal
from types import FrameType


def interrupt_once(number: int, frame: FrameType | None) -> None:
    """Handler: raises KeyboardInterrupt as Ctrl-C does, and ignores every later SIGHUP.

    The shell and the kernel both report a lost terminal. The second signal may come while the
    first interruption removes what a command made, and would leave the rest of it behind.
    """
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    raise KeyboardInterrupt
