# SPDX-License-Identifier: Apache-2.0
"""Namespaces of a link: identical TCP settings in both, and checks before the setup."""

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
    # Default algorithms differ between hosts; bbr, for one, behaves differently on a varying link.
    "net/ipv4/tcp_congestion_control": "cubic",
    # Otherwise a run would start with cached TCP metrics of the path from the previous run.
    "net/ipv4/tcp_no_metrics_save": "1",
    # Receive buffers start at their final size: on Linux 6.18 auto-tuning left every fourth
    # connection at its first 64 KiB window, with 16 instead of 500 Mbit/s at 40 ms.
    "net/ipv4/tcp_rmem": "4096 4194304 33554432",
}

ALLOWED = Path("/proc/sys/net/ipv4/tcp_allowed_congestion_control")
"""Exists only in the initial namespace and limits the choice in all others."""


@contextlib.contextmanager
def _cubic_allowed() -> Iterator[None]:
    """Temporarily allows cubic in namespaces: a host may allow only reno and its default."""
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
    """Sets the same TCP options on every host; returns the values that the kernel then reports."""

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
    """Returns the result of `work` on a pyroute2.IPRoute inside the namespace.

    Avoids pyroute2.NetNS, which forks this whole process for every socket.
    """

    def visit() -> Result:
        with IPRoute() as netlink:
            return work(netlink)

    return inside(namespace, visit)


def check_privilege(what: str) -> None:
    """Raises SlambedError unless this process has the privilege to enter namespaces."""
    if os.geteuid() != 0:
        raise environment_error(f"{what} needs root; run with sudo, or engine virtual")


def different(mobile: str | Path, edge: str | Path) -> None:
    """Rejects two ends in one namespace: the kernel would deliver locally and bypass the link."""
    with contextlib.suppress(OSError):
        if namespace_path(mobile).samefile(namespace_path(edge)):
            raise SlambedError(
                f"both nodes are in the same network namespace, {mobile}; give each its own"
            )
