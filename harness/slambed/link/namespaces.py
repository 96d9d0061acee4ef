# SPDX-License-Identifier: Apache-2.0
"""The namespaces of a link: equal TCP settings in both, and what may go wrong before it is up."""

import contextlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from pyroute2 import IPRoute

from slambed.errors import SlambedError, environment_error
from slambed.process.namespaces import inside, namespace_path

Result = TypeVar("Result")

TCP_SETTINGS = {
    # Machines differ in their default; bbr, for one, behaves quite differently on a changing link.
    "net/ipv4/tcp_congestion_control": "cubic",
    # Or a run would start with what the run before it learned about the path.
    "net/ipv4/tcp_no_metrics_save": "1",
    # Receive buffers start where auto-tuning would end: on Linux 6.18 every fourth connection was
    # seen to stay at its first 64 KiB window for good, 16 instead of 500 Mbit/s at 40 ms.
    "net/ipv4/tcp_rmem": "4096 4194304 33554432",
}

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


def by_netlink(namespace: str | Path, work: Callable[[Any], Result]) -> Result:
    """The result of `work` on a pyroute2.IPRoute inside the namespace.

    Not pyroute2.NetNS, which forks this whole process for every socket.
    """

    def visit() -> Result:
        with IPRoute() as netlink:
            return work(netlink)

    return inside(namespace, visit)


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
