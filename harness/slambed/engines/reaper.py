# SPDX-License-Identifier: Apache-2.0
"""Removes what a killed harness left on the host: containers, processes, cgroups.

This is safe only under the host lock: then nothing with our label belongs to a running campaign.
"""

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import docker
import psutil
from docker.errors import APIError

from slambed.engines.base import LABEL
from slambed.engines.cgroups import CgroupMaker, remove
from slambed.engines.docker_errors import CONFLICT, DAEMON_ERRORS, GONE, docker_error
from slambed.engines.helper import is_root

OWNER_VARIABLE = "SLAMBED_HARNESS"
"""Environment variable of every child: process id and start time of its harness."""


@dataclass
class Reaped:
    """The leftovers that were found and removed."""

    containers: list[str] = field(default_factory=list)
    processes: list[int] = field(default_factory=list)
    groups: list[Path] = field(default_factory=list)

    def __str__(self) -> str:
        parts = [
            f"{len(items)} {name}"
            for name, items in (
                ("containers", self.containers),
                ("processes", self.processes),
                ("control groups", self.groups),
            )
            if items
        ]
        return ", ".join(parts)


@contextlib.contextmanager
def mark_children() -> Iterator[None]:
    """Marks child processes that the block starts as ours. What a notebook starts afterwards is
    not, and no later campaign ends it."""
    before = os.environ.get(OWNER_VARIABLE)
    os.environ[OWNER_VARIABLE] = f"{os.getpid()}:{start_time(os.getpid())}"
    try:
        yield
    finally:
        if before is None:
            del os.environ[OWNER_VARIABLE]
        else:
            os.environ[OWNER_VARIABLE] = before


def start_time(pid: int) -> int | None:
    """Returns the start time of a process in clock ticks since boot, which together with the
    process id is unique.

    psutil's create_time is not used: it is a time of day that shifts when the clock is set, so
    children of a running harness would look like orphans.
    """
    try:
        # The command in parentheses may contain spaces: count the fields after it.
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    return int(fields[19])


def reap() -> Reaped:
    """Removes all leftovers of dead harness processes."""
    reaped = Reaped()
    _reap_containers(reaped)
    _reap_processes(reaped)
    # Only root may remove cgroups; other users' nodes are containers, which remove theirs.
    for folder in CgroupMaker().leftovers() if is_root() else ():
        if remove(folder) and folder.name != LABEL:
            reaped.groups.append(folder)
    return reaped


def _reap_containers(reaped: Reaped) -> None:
    try:
        client = docker.from_env(timeout=20)
        containers = client.containers.list(all=True, filters={"label": LABEL})
    except DAEMON_ERRORS:
        return  # without a daemon there are no containers
    for container in containers:
        try:
            container.remove(force=True, v=True)
            reaped.containers.append(str(container.name))
        except DAEMON_ERRORS as error:
            # It is already being removed by its own exit or by another process.
            code = getattr(error.response, "status_code", 0) if isinstance(error, APIError) else 0
            if code not in (GONE, CONFLICT):
                raise docker_error(error, f"remove container {container.name}") from None
    client.close()


def _reap_processes(reaped: Reaped) -> None:
    for process in psutil.process_iter():
        # It ended in the meantime, or belongs to another user.
        with contextlib.suppress(psutil.NoSuchProcess, psutil.AccessDenied):
            mark = process.environ().get(OWNER_VARIABLE, "")
            if not mark or process.pid == os.getpid():
                continue
            owner, _, began = mark.partition(":")
            if not owner.isdigit() or str(start_time(int(owner))) != began:
                process.kill()
                reaped.processes.append(process.pid)
