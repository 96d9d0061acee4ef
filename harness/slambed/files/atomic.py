# SPDX-License-Identifier: Apache-2.0
"""Files that are there whole or not at all: written beside their place, then renamed to it; and
one process at a time that makes them."""

import fcntl
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO


@contextmanager
def replacing(path: Path, *, rivals: bool = False, durable: bool = False) -> Iterator[Path]:
    """Gives a hidden file beside `path` to write, which takes its place when the block ends well.

    A kill leaves the old file or the new one at `path`; an error leaves the old one and nothing
    beside it.

    rivals: other processes may write the same file at the same time; each has a file of its own
    then, which a kill leaves behind.
    durable: the content reaches the disk before the name does, so that power may fail too.
    """
    own = f"{os.getpid()}." if rivals else ""
    partial = path.with_name(f".{path.name}.{own}partial")
    try:
        yield partial
        if durable:
            with partial.open("rb") as written:
                os.fsync(written.fileno())
        partial.rename(path)
    except BaseException as error:
        if isinstance(error, OSError) and error.filename is None:
            error.filename = str(path)  # whoever reports it shall know where
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise


def lock_file(file: IO[str], what: str, notify: Callable[[str], None]) -> None:
    """Locks an open file for as long as it is open. Whoever has to wait says for what, and that it
    goes on."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        notify(f"waiting: another process {what}")
        fcntl.flock(file, fcntl.LOCK_EX)
        notify("going on")
