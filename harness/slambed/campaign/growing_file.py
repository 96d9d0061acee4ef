# SPDX-License-Identifier: Apache-2.0
"""Reads JSON lines that another process is still writing, incrementally."""

from pathlib import Path

from slambed.metrics.events import Event, parse_line


class GrowingFile:
    """Follows a growing file of JSON lines; opens it read-only and only briefly."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._read = 0
        self._inode = -1

    def new(self) -> list[Event]:
        """Returns the objects written since the last call, without an incomplete last line. A
        replaced file is read from its beginning; a missing file gives an empty list."""
        try:
            with self.path.open("rb") as file:
                status = self.path.stat()
                if status.st_ino != self._inode or status.st_size < self._read:
                    self._inode, self._read = status.st_ino, 0
                file.seek(self._read)
                data = file.read()
        except OSError:
            return []
        whole = data[: data.rfind(b"\n") + 1]
        self._read += len(whole)
        lines = (parse_line(line) for line in whole.splitlines())
        return [value for value in lines if value is not None]
