# SPDX-License-Identifier: Apache-2.0
"""Small kernel files that are read again and again: opened once, read from the start each time."""

import os
from pathlib import Path

LARGEST_BYTES = 16384


class KeptFiles:
    """Open files by path. Opening a file costs more than the kernel needs to write it."""

    def __init__(self) -> None:
        self._fds: dict[Path, int] = {}

    def read(self, path: Path) -> str:
        """Its content now; OSError when it has gone."""
        if (fd := self._fds.get(path)) is None:
            fd = self._fds[path] = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            return os.pread(fd, LARGEST_BYTES, 0).decode("ascii", errors="replace")
        except OSError:
            self.forget(path)
            raise

    def forget(self, path: Path) -> None:
        """Closes one file, if it is open."""
        if (fd := self._fds.pop(path, None)) is not None:
            os.close(fd)

    def close(self) -> None:
        """Closes all of them."""
        for path in list(self._fds):
            self.forget(path)
