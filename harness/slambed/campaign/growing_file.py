# SPDX-License-Identifier: Apache-2.0
"""JSON lines that another process is still writing: each time what has come since."""

from pathlib import Path

from slambed.metrics.events import Event, parse_line


class GrowingFile:
    """Reads a file of JSON lines as it grows; opens it for reading alone, and only for a moment."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._read = 0
        self._inode = -1

    def new(self) -> list[Event]:
        """Whole objects that were written since the last call; a line that is not whole yet comes
        the next time. A file that took the place of the old one is read from its beginning. None
        where it is not there."""
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
