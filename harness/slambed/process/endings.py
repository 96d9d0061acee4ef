# SPDX-License-Identifier: Apache-2.0
"""How a process ended, and whether something outside it caused that."""

import signal

FROM_OUTSIDE = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
"""No program sends these to itself; the kernel's OOM killer, a stopping daemon or a user does."""
BY_SHELLS = 128
"""Shells and Docker report the end by signal n as exit code 128 + n."""


def signal_of(code: int) -> int | None:
    """Returns the signal that ended a process; None when it exited by itself."""
    if code < 0:
        return -code
    return code - BY_SHELLS if BY_SHELLS < code <= BY_SHELLS + signal.NSIG else None


def ended_from_outside(code: int) -> bool:
    """Returns whether something outside the process ended it; a crash has another signal."""
    return signal_of(code) in FROM_OUTSIDE


def ending(code: int) -> str:
    """Returns `signal 11, SIGSEGV` or `exit code 3`."""
    number = signal_of(code)
    if number is None:
        return f"exit code {code}"
    names = {member.value: member.name for member in signal.Signals}
    return f"signal {number}, {names.get(number, 'unknown')}"
