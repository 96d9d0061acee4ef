# SPDX-License-Identifier: Apache-2.0
"""Standard streams that the caller closed, or whose terminal or reader has gone. Both kinds then
behave like /dev/null, so that no run fails because of them."""

import errno
import io
import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager

INPUT, OUTPUT, ERROR = range(3)
GONE = select.POLLERR | select.POLLHUP | select.POLLNVAL


def open_closed() -> None:
    """Replaces closed streams. Must run before any other file is opened: that file would get the
    free number, and printed output would be written into it."""
    for number, mode in ((INPUT, os.O_RDONLY), (OUTPUT, os.O_WRONLY), (ERROR, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            # os.open returns the lowest free number, which is this one. Children inherit it like
            # the other streams.
            os.set_inheritable(os.open(os.devnull, mode), True)
    # sys.stdin etc. are None for streams that were closed when Python started.
    sys.stdin = sys.stdin or os.fdopen(INPUT, closefd=False)
    sys.stdout = sys.stdout or os.fdopen(OUTPUT, "w", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(ERROR, "w", closefd=False)


def accept_any_text() -> None:
    """Lets a terminal or pipe without Unicode (`PYTHONIOENCODING=ascii`, a locale of Latin 1)
    print `?` for a character that it does not have, instead of ending the command. Standard error
    keeps Python's own way, `\\xfc`."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and _refuses(stream):
            stream.reconfigure(errors="replace")


def _refuses(stream: io.TextIOWrapper) -> bool:
    """Returns whether printing some characters to this stream raises an error. `surrogateescape`,
    Python's choice in the locale C, prints any bytes of file names, but no character that the
    encoding lacks."""
    unicode = stream.encoding.lower().startswith("utf")
    return stream.errors == "strict" or (stream.errors == "surrogateescape" and not unicode)


def is_gone(number: int) -> bool:
    """Returns whether the reader of this stream has gone."""
    stream = select.poll()
    stream.register(number, 0)
    return any(event & GONE for _, event in stream.poll(0))


def replace_gone() -> bool:
    """Redirects outputs without a reader or terminal to /dev/null; returns whether there were
    any."""
    gone = [number for number in (OUTPUT, ERROR) if is_gone(number)]
    for number in gone:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, number)
        os.close(nowhere)
    return bool(gone)


@contextmanager
def without_terminal() -> Iterator[None]:
    """Printing inside is lost if the terminal has gone, but raises nothing. Whether that ends the
    command is decided by SIGHUP alone, which may come before or after the failed print."""
    try:
        yield
    except OSError as error:
        if error.errno != errno.EIO:
            raise
        replace_gone()
