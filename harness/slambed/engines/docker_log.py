# SPDX-License-Identifier: Apache-2.0
"""What a container prints, written to a file while it runs, up to a limit."""

import contextlib
import threading
from pathlib import Path
from typing import Any

from slambed.engines.docker_errors import DAEMON_ERRORS


class FollowedLog:
    """Follows the output of a started container from its beginning. The daemon keeps the output
    where other users cannot see how large it is; in the run folder it counts like any file."""

    def __init__(self, container: Any, path: Path, limit_bytes: int | None) -> None:
        self._container = container
        self._path = path
        self._limit_bytes = limit_bytes
        self._thread = threading.Thread(target=self._follow, name="container-log", daemon=True)
        self._thread.start()

    def whole(self, timeout_s: float) -> None:
        """Waits until the output of an ended container has been written."""
        self._thread.join(timeout_s)

    def _follow(self) -> None:
        left = self._limit_bytes
        # A daemon that restarts ends the stream; the run then has what was printed before.
        with contextlib.suppress(*DAEMON_ERRORS, OSError), self._path.open("wb", 0) as log:
            for part in self._container.logs(stream=True, follow=True):
                log.write(part if left is None else part[:left])
                left = None if left is None else left - len(part)
                if left is not None and left <= 0:
                    return
