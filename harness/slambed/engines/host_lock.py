# SPDX-License-Identifier: Apache-2.0
"""Allows one live campaign at a time per host: two would share cores and distort each other's
results."""

import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

from slambed.engines.lock_file import default_lock_path, open_lock, taken
from slambed.errors import environment_error
from slambed.files.json_file import read_object

WAIT_STEP_S = 0.2
STOP_OR_WAIT = "stop it, or wait for it: 'slambed run' has --wait"
STOP = "stop it, or call this again when it has ended"
"""Advice of commands that do not wait."""


@contextmanager
def host_lock(
    purpose: str,
    path: Path | None = None,
    wait_s: float = 0.0,
    conflict: str = "another live campaign runs on this host",
    *,
    where: Path | None = None,
    advice: str = STOP_OR_WAIT,
    notify: Callable[[str], None] = lambda line: None,
    meanwhile: Callable[[], object] = lambda: None,
) -> Iterator[None]:
    """Holds the lock; the error names the current holder. The kernel releases it even if the holder
    dies.

    `where`: path shown to waiting processes. `notify` is called when waiting begins, with the
    holder, and when it ends. `meanwhile` is called repeatedly while waiting; an exception ends the
    wait.
    """
    path = path or default_lock_path()
    fd = open_lock(path)
    try:
        _take(fd, path, wait_s, conflict, advice, notify, meanwhile)
        note = {"pid": os.getpid(), "purpose": purpose, "since_utc": _now().isoformat()}
        if where is not None:
            note["where"] = str(where.absolute())
        os.ftruncate(fd, 0)
        os.pwrite(fd, json.dumps(note).encode(), 0)
        yield
    finally:
        os.close(fd)


def _take(
    fd: int,
    path: Path,
    wait_s: float,
    conflict: str,
    advice: str,
    notify: Callable[[str], None],
    meanwhile: Callable[[], object],
) -> None:
    began_s = time.monotonic()
    notified = False
    while not taken(fd):
        if time.monotonic() - began_s >= wait_s:
            raise environment_error(f"{conflict}: {_holder(path)}; {advice}")
        if not notified:
            notify(f"waiting: {conflict}: {_holder(path)}")
            notified = True
        meanwhile()
        time.sleep(WAIT_STEP_S)
    if notified:
        waited = timedelta(seconds=round(time.monotonic() - began_s))
        notify(f"going on at {_now():%H:%M:%S} UTC, after {waited} of waiting")


def _holder(path: Path) -> str:
    content = read_object(path) or {}
    if not {"purpose", "pid"} <= content.keys():
        return "unknown"
    message = f"{content['purpose']} (process {content['pid']})"
    with suppress(KeyError, TypeError, ValueError):  # written by an earlier version
        message += f", since {datetime.fromisoformat(content['since_utc']):%Y-%m-%d %H:%M:%S} UTC"
    return message + (f", in {content['where']}" if "where" in content else "")


def _now() -> datetime:
    return datetime.now(UTC).replace(microsecond=0)
