# SPDX-License-Identifier: Apache-2.0
"""One live campaign at a time on a host: two would share cores and spoil each other's figures."""

import fcntl
import json
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from slambed.errors import environment_error
from slambed.json_file import read_object

# Known to every user and checkout of the host.
LOCK_FOLDER = Path("/run/lock")
WAIT_STEP_S = 0.2


def default_lock_path() -> Path:
    """/run/lock/slambed.lock, or the temporary folder where there is no /run/lock."""
    folder = LOCK_FOLDER if LOCK_FOLDER.is_dir() else Path(tempfile.gettempdir())
    return folder / "slambed.lock"


@contextmanager
def host_lock(
    purpose: str,
    path: Path | None = None,
    wait_s: float = 0.0,
    conflict: str = "another live campaign runs on this host",
) -> Iterator[None]:
    """Holds the lock; an error says who holds it. The kernel frees it however the holder dies."""
    path = path or default_lock_path()
    fd = _open(path)
    try:
        deadline = time.monotonic() + wait_s
        while not _taken(fd):
            if time.monotonic() >= deadline:
                raise environment_error(
                    f"{conflict}: {_holder(path)}; stop it, or wait for it with --wait"
                )
            time.sleep(WAIT_STEP_S)
        os.ftruncate(fd, 0)
        os.pwrite(fd, json.dumps({"pid": os.getpid(), "purpose": purpose}).encode(), 0)
        yield
    finally:
        os.close(fd)


def _open(path: Path) -> int:
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


def _taken(fd: int) -> bool:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _holder(path: Path) -> str:
    content = read_object(path) or {}
    if not {"purpose", "pid"} <= content.keys():
        return "unknown"
    return f"{content['purpose']} (process {content['pid']})"
