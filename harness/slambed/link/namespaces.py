# SPDX-License-Identifier: Apache-2.0
"""Doing things inside another network namespace, without leaving this process."""

import contextlib
import ctypes
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from slambed.errors import SlambedError, environment_error

Result = TypeVar("Result")

CLONE_NEWNET = 0x40000000
TCP_SETTINGS = {
    # Machines differ in their default; bbr, for one, behaves quite differently on a changing link.
    "net/ipv4/tcp_congestion_control": "cubic",
    # Or a run would start with what the run before it learned about the path.
    "net/ipv4/tcp_no_metrics_save": "1",
    # Receive buffers start where auto-tuning would end: on Linux 6.18 every fourth connection was
    # seen to stay at its first 64 KiB window for good, 16 instead of 500 Mbit/s at 40 ms.
    "net/ipv4/tcp_rmem": "4096 4194304 33554432",
}


def namespace_path(namespace: str | Path) -> Path:
    """A namespace's file: a path, or a name that `ip netns` knows."""
    text = str(namespace)
    return Path(text) if "/" in text else Path("/run/netns") / text


def inside(namespace: str | Path, work: Callable[[], Result]) -> Result:
    """The result of `work` done by a short-lived thread inside the namespace.

    Sockets it opens keep belonging to that namespace and can be used anywhere afterwards.
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


ALLOWED = Path("/proc/sys/net/ipv4/tcp_allowed_congestion_control")
"""Exists in the initial namespace only, and rules what the others may choose."""


@contextlib.contextmanager
def _cubic_allowed() -> Iterator[None]:
    """Lets namespaces choose cubic while it lasts: a host may allow only reno and its default."""
    wanted = TCP_SETTINGS["net/ipv4/tcp_congestion_control"]
    before = ""
    with contextlib.suppress(OSError):
        before = ALLOWED.read_text(encoding="ascii").strip()
        if before and wanted not in before.split():
            ALLOWED.write_text(f"{before} {wanted}", encoding="ascii")
    try:
        yield
    finally:
        if before:
            with contextlib.suppress(OSError):
                ALLOWED.write_text(before, encoding="ascii")


def tune_tcp(namespace: str | Path) -> dict[str, str]:
    """Same TCP on every host; returns what the kernel says it is now."""

    def work() -> dict[str, str]:
        for key, value in TCP_SETTINGS.items():
            path = Path("/proc/sys") / key
            try:
                path.write_text(value, encoding="ascii")
            except OSError as error:
                raise environment_error(
                    f"cannot set {key.replace('/', '.')}={value}: {error.strerror}, {namespace}; "
                    "run as root on a kernel with TCP cubic"
                ) from None
        return {key: _read(key) for key in [*TCP_SETTINGS, "net/ipv4/tcp_slow_start_after_idle"]}

    with _cubic_allowed():
        return inside(namespace, work)


def _read(key: str) -> str:
    with contextlib.suppress(OSError):
        return (Path("/proc/sys") / key).read_text(encoding="ascii").strip()
    return ""


def check_privilege(what: str) -> None:
    """Raises with one clear line unless this process may enter namespaces."""
    if os.geteuid() != 0:
        raise environment_error(f"{what} needs root; run with sudo, or engine virtual")


def different(mobile: str | Path, edge: str | Path) -> None:
    """Both ends in one namespace would make the kernel deliver locally, past the link."""
    with contextlib.suppress(OSError):
        if namespace_path(mobile).samefile(namespace_path(edge)):
            raise SlambedError(
                f"both nodes are in the same network namespace, {mobile}; give each its own"
            )
