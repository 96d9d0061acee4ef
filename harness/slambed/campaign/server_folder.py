# SPDX-License-Identifier: Apache-2.0
"""Where multiprocessing keeps the socket of its fork server: a temporary folder that nobody removes
when harness and server are killed, so the next campaign does."""

import fcntl
import multiprocessing.util
import os
import shutil
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

PREFIX = "slambed-fork-"
LONGEST = 50
"""Letters of the folder above: the address of a socket has at most 107."""
SHORT = "/tmp"


def sweep(prefix: str = PREFIX) -> None:
    """Removes the folders whose harness has died: with it went its lock."""
    for left in Path(_parent()).glob(f"{prefix}*"):
        # Another user's, or swept by somebody else at this moment.
        with suppress(OSError):
            lock = locked(left)
            shutil.rmtree(left, ignore_errors=True)
            os.close(lock)


@cache
def choose() -> Path:
    """The folder of this process, for what multiprocessing starts from here on; ours until we
    end, however we do."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=_parent()))
        with suppress(OSError):
            lock = locked(folder)
            if folder.exists():
                break
            os.close(lock)  # swept before it was locked
    before, tempfile.tempdir = tempfile.tempdir, str(folder)
    try:
        multiprocessing.util.get_temp_dir()
    finally:
        tempfile.tempdir = before
    # After multiprocessing has removed its own in it (priority -100).
    ignore = {"ignore_errors": True}
    multiprocessing.util.Finalize(None, shutil.rmtree, [folder], ignore, exitpriority=-200)
    return folder


def _parent() -> str:
    found = tempfile.gettempdir()
    return found if len(found) <= LONGEST else SHORT


def locked(folder: Path) -> int:
    """Holds it as long as the descriptor is open; BlockingIOError while another process has it."""
    opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(opened)
        raise
    return opened
