# SPDX-License-Identifier: Apache-2.0
"""Executes functions in another network namespace, without moving this process."""

import ctypes
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from slambed.errors import environment_error

Result = TypeVar("Result")

CLONE_NEWNET = 0x40000000


def namespace_path(namespace: str | Path) -> Path:
    """Returns the file of a namespace, given as a path or a name of `ip netns`."""
    text = str(namespace)
    return Path(text) if "/" in text else Path("/run/netns") / text


def inside(namespace: str | Path, work: Callable[[], Result]) -> Result:
    """Runs `work` in a short-lived thread inside the namespace and returns its result.

    Sockets that it opens stay in that namespace and can be used from any thread afterwards.
    """
    path = namespace_path(namespace)
    outcome: list[Result] = []
    failure: list[BaseException] = []

    def visit() -> None:
        try:
            _enter(path)
            outcome.append(work())
        except BaseException as error:
            failure.append(error)

    thread = threading.Thread(target=visit, name="netns", daemon=True)
    thread.start()
    thread.join()
    if failure:
        raise failure[0]
    return outcome[0]


def _enter(path: Path) -> None:
    try:
        fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise environment_error(
            f"cannot open the network namespace: {error.strerror}, {path}; start the node first"
        ) from None
    try:
        if ctypes.CDLL(None, use_errno=True).setns(fd, CLONE_NEWNET) != 0:
            reason = os.strerror(ctypes.get_errno())
            raise environment_error(
                f"cannot enter the network namespace: {reason}, {path}; run as root"
            )
    finally:
        os.close(fd)
