# SPDX-License-Identifier: Apache-2.0
"""Two temporary network namespaces of this process, for tests and benchmarks."""

import contextlib
import ctypes
import os
import threading
from collections.abc import Iterator
from pathlib import Path

from slambed.errors import environment_error
from slambed.process.namespaces import CLONE_NEWNET


def _new_namespace() -> int:
    """Returns a descriptor of a new namespace, which vanishes when the descriptor is closed."""
    found: list[int] = []
    failure: list[str] = []

    def visit() -> None:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.unshare(CLONE_NEWNET) != 0:
            failure.append(os.strerror(ctypes.get_errno()))
            return
        found.append(os.open("/proc/thread-self/ns/net", os.O_RDONLY | os.O_CLOEXEC))

    thread = threading.Thread(target=visit, name="new-netns")
    thread.start()
    thread.join()
    if failure:
        raise environment_error(f"cannot make a network namespace: {failure[0]}; run as root")
    return found[0]


@contextlib.contextmanager
def two_namespaces() -> Iterator[tuple[Path, Path]]:
    """Yields the paths (mobile, edge), which other programs can also open inside the block."""
    held: list[int] = []
    try:
        held = [_new_namespace(), _new_namespace()]
        mobile, edge = (Path(f"/proc/{os.getpid()}/fd/{fd}") for fd in held)
        yield mobile, edge
    finally:
        for fd in held:
            os.close(fd)
