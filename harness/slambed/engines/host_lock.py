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
    try:
        # Not truncated on open: until the lock is ours the content is the holder's.
        fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise environment_error(f"cannot open {path}: {error.strerror}; run with sudo") from None
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


def _taken(fd: int) -> bool:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _holder(path: Path) -> str:
    try:
        content = json.loads(path.read_text())
        return f"{content['purpose']} (process {content['pid']})"
    except (OSError, ValueError, KeyError):
        return "unknown"
