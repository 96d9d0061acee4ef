# SPDX-License-Identifier: Apache-2.0
"""Atomic files: written under a temporary name, then renamed; and locks for their creation."""

import fcntl
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO


@contextmanager
def replacing(path: Path, *, rivals: bool = False, durable: bool = False) -> Iterator[Path]:
    """Yields a hidden file next to `path` that replaces it when the block succeeds.

    After a kill `path` holds the old or the new file. After an error it holds the old file, and the
    hidden file is removed.

    rivals: other processes may write the same path concurrently. Each one has its own hidden file,
    which a kill leaves behind.

    durable: the content is synced to disk before the rename, so that it survives a power failure.
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
            error.filename = str(path)  # so that the error names the file
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise


def lock_file(file: IO[str], what: str, notify: Callable[[str], None]) -> None:
    """Locks an open file until it is closed. Notifies before waiting for another process, and
    after."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        notify(f"waiting: another process {what}")
        fcntl.flock(file, fcntl.LOCK_EX)
        notify("going on")
