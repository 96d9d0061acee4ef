# SPDX-License-Identifier: Apache-2.0
"""Small kernel files that are read repeatedly: opened once, read from the start each time."""

import os

LARGEST_BYTES = 16384


class KeptFiles:
    """Open files by path. Opening such a file costs more than reading it."""

    def __init__(self) -> None:
        # Keyed by str: hashing a Path costs as much as reading the file.
        self._fds: dict[str, int] = {}

    def read(self, path: str) -> str:
        """Returns the current content. Raises OSError when the file has gone."""
        if (fd := self._fds.get(path)) is None:
            fd = self._fds[path] = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            return os.pread(fd, LARGEST_BYTES, 0).decode("ascii", errors="replace")
        except OSError:
            self.forget(path)
            raise

    def forget(self, path: str) -> None:
        """Closes one file, if it is open."""
        if (fd := self._fds.pop(path, None)) is not None:
            os.close(fd)

    def close(self) -> None:
        for path in list(self._fds):
            self.forget(path)
