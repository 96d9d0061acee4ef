# SPDX-License-Identifier: Apache-2.0
"""The bytes that a run may write: a system that writes without end must not fill the disk."""

import os
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from stat import S_ISREG

from slambed.files.atomic import replacing

MIB = 1 << 20
LOOK_EVERY_S = 0.25
LARGEST_SHARE = 0.05
"""Largest share of its time that the harness spends counting: a folder may hold many files."""
BLOCK_BYTES = 512
"""Unit of st_blocks (POSIX)."""
LEAST_BYTES = 4096
"""What a file counts at least, so that empty ones are bounded too."""
KEPT_BYTES = 16 * MIB
"""What is kept of a file of a run that was ended: its beginning."""


class TooManyBytesError(Exception):
    """The run wrote more than it may and must end; the message is the reason."""


class WrittenBytes:
    """Counts what a run has written into its folder."""

    def __init__(self, folder: Path, limit_mb: int) -> None:
        self._folder = folder
        self._limit_mb = limit_mb
        self._next_s = 0.0
        self._struck = False

    @property
    def limit_bytes(self) -> int:
        """Bytes that the run may write."""
        return self._limit_mb * MIB

    def watch(self) -> None:
        """Raises TooManyBytesError if the run must end. Looks at most every LOOK_EVERY_S."""
        began_s = time.monotonic()
        if began_s < self._next_s:
            return
        self.look()
        took_s = time.monotonic() - began_s
        self._next_s = began_s + max(LOOK_EVERY_S, took_s / LARGEST_SHARE)

    def look(self) -> None:
        """Like `watch`, but looks now."""
        sizes = dict(_files(self._folder))
        if sum(sizes.values()) < self.limit_bytes:
            return
        self._struck = True
        largest = max(sizes, key=lambda path: sizes[path])
        raise TooManyBytesError(
            f"it wrote more than {self._limit_mb} MiB (max_run_mb of the experiment): "
            f"{len(sizes)} files, the largest is {largest.relative_to(self._folder)} with "
            f"{sizes[largest] / MIB:.0f} MiB"
        )

    def cut(self) -> None:
        """Shortens the large files of a run that wrote too much to their beginnings: its metrics
        need not read all of it, and the store need not keep it."""
        if not self._struck:
            return
        for path, size in list(_files(self._folder)):
            if size <= KEPT_BYTES or not S_ISREG(path.lstat().st_mode):
                continue
            with suppress(OSError):
                with path.open("rb") as whole:
                    begin = whole.read(KEPT_BYTES)
                with replacing(path) as out:
                    out.write_bytes(begin[: begin.rfind(b"\n") + 1] or begin)


def _files(folder: Path) -> Iterator[tuple[Path, int]]:
    """Yields files with the bytes that they take. What vanishes meanwhile, and folders that this
    user may not read, do not count."""
    pending = [folder]
    while pending:
        with suppress(OSError), os.scandir(pending.pop()) as entries:
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    pending.append(Path(entry.path))
                    continue
                status = entry.stat(follow_symlinks=False)
                yield Path(entry.path), max(LEAST_BYTES, status.st_blocks * BLOCK_BYTES)
