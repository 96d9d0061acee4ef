# SPDX-License-Identifier: Apache-2.0
"""Folder for the socket of multiprocessing's fork server. Nobody removes it when harness and
server are killed, so the next campaign does."""

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
"""Maximum length of the parent folder's path: a socket address has at most 107 characters."""
SHORT = "/tmp"


def sweep(prefix: str = PREFIX) -> None:
    """Removes the folders of dead harnesses, whose locks are free."""
    for left in Path(_parent()).glob(f"{prefix}*"):
        # Fails for a folder of another user, or one being removed concurrently.
        with suppress(OSError):
            lock = locked(left)
            shutil.rmtree(left, ignore_errors=True)
            os.close(lock)


@cache
def choose() -> Path:
    """Returns the folder of this process, which multiprocessing uses from now on; locked until
    this process ends."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=_parent()))
        with suppress(OSError):
            lock = locked(folder)
            if folder.exists():
                break
            os.close(lock)  # removed by another process before it was locked
    before, tempfile.tempdir = tempfile.tempdir, str(folder)
    try:
        multiprocessing.util.get_temp_dir()
    finally:
        tempfile.tempdir = before
    # Runs after multiprocessing has removed its own files (priority -100).
    ignore = {"ignore_errors": True}
    multiprocessing.util.Finalize(None, shutil.rmtree, [folder], ignore, exitpriority=-200)
    return folder


def _parent() -> str:
    found = tempfile.gettempdir()
    return found if len(found) <= LONGEST else SHORT


def locked(folder: Path) -> int:
    """Locks a folder until the returned descriptor is closed. Raises BlockingIOError if another
    process holds the lock."""
    opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(opened)
        raise
    return opened
