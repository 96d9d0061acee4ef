# SPDX-License-Identifier: Apache-2.0
"""The file by which live campaigns of a host, and boards that one of them has, keep out of each
other's way. Needs nothing but Python: it is read on boards, too."""

import fcntl
import os
import tempfile
from pathlib import Path

from slambed.errors import environment_error

# Known to every user and checkout of the host.
LOCK_FOLDER = Path("/run/lock")


def default_lock_path() -> Path:
    """/run/lock/slambed.lock, or the temporary folder where there is no /run/lock."""
    folder = LOCK_FOLDER if LOCK_FOLDER.is_dir() else Path(tempfile.gettempdir())
    return folder / "slambed.lock"


def open_lock(path: Path) -> int:
    """The lock file, made for every user of the host when it is not there.

    Not truncated: until the lock is ours the content is the holder's. Not opened with O_CREAT when
    it is there: in a folder like /tmp the kernel refuses that even to root (fs.protected_regular).
    """
    flags = os.O_RDWR | os.O_CLOEXEC
    try:
        try:
            return os.open(path, flags)
        except FileNotFoundError:
            fd = os.open(path, flags | os.O_CREAT, 0o666)
            # Whatever the umask: the next campaign may be another user's.
            os.fchmod(fd, 0o666)
            return fd
    except OSError as error:
        raise environment_error(
            f"cannot open {path}: {error.strerror}; once as root: install -m 666 /dev/null {path}"
        ) from None


def taken(fd: int) -> bool:
    """Whether the lock is ours now."""
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
