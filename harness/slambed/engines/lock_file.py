# SPDX-License-Identifier: Apache-2.0
"""The lock file of live campaigns on a host, and of boards in use. This module needs only the
standard library because it also runs on boards."""

import fcntl
import os
import tempfile
from pathlib import Path

from slambed.errors import environment_error

# Common to all users and checkouts of the host.
LOCK_FOLDER = Path("/run/lock")


def default_lock_path() -> Path:
    """Returns /run/lock/slambed.lock, or a file in the temporary folder without /run/lock."""
    folder = LOCK_FOLDER if LOCK_FOLDER.is_dir() else Path(tempfile.gettempdir())
    return folder / "slambed.lock"


def open_lock(path: Path) -> int:
    """Opens the lock file; creates it for all users of the host if missing.

    It is not truncated: until we hold the lock, the content is the holder's. An existing file is
    not opened with O_CREAT: in a folder like /tmp the kernel refuses that even to root
    (fs.protected_regular).
    """
    flags = os.O_RDWR | os.O_CLOEXEC
    try:
        try:
            return os.open(path, flags)
        except FileNotFoundError:
            fd = os.open(path, flags | os.O_CREAT, 0o666)
            # Independent of the umask: the next campaign may be another user's.
            os.fchmod(fd, 0o666)
            return fd
    except OSError as error:
        raise environment_error(
            f"cannot open {path}: {error.strerror}; once as root: install -m 666 /dev/null {path}"
        ) from None


def taken(fd: int) -> bool:
    """Tries to take the lock; returns whether we hold it."""
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
