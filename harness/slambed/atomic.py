# SPDX-License-Identifier: Apache-2.0
"""Files that are there whole or not at all: written beside their place, then renamed to it."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


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
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
