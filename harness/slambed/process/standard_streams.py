# SPDX-License-Identifier: Apache-2.0
"""Standard input, output and error as whoever called left them: closed, or gone meanwhile with a
terminal or a reader. Both behave like /dev/null: no run fails for want of somebody who reads."""

import os
import select
import sys

INPUT, OUTPUT, ERROR = range(3)
GONE = select.POLLERR | select.POLLHUP | select.POLLNVAL


def open_closed() -> None:
    """Before any other file is opened, which would get the number of a closed one and be written
    into by whatever prints."""
    for number, mode in ((INPUT, os.O_RDONLY), (OUTPUT, os.O_WRONLY), (ERROR, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            # The lowest free number, which is this one; children inherit it like the others.
            os.set_inheritable(os.open(os.devnull, mode), True)
    # Python has none of those that were closed when it started.
    sys.stdin = sys.stdin or os.fdopen(INPUT, closefd=False)
    sys.stdout = sys.stdout or os.fdopen(OUTPUT, "w", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(ERROR, "w", closefd=False)


def is_gone(number: int) -> bool:
    """Whether nobody can read any more what is written there."""
    stream = select.poll()
    stream.register(number, 0)
    return any(event & GONE for _, event in stream.poll(0))


def replace_gone() -> bool:
    """Outputs whose reader or terminal has gone take everything from now on; whether there were
    any."""
    gone = [number for number in (OUTPUT, ERROR) if is_gone(number)]
    for number in gone:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, number)
        os.close(nowhere)
    return bool(gone)
