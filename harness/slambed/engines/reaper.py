# SPDX-License-Identifier: Apache-2.0
"""Removes what a killed harness left on the host: containers, processes, control groups.

Safe only under the host lock: then whatever carries our label belongs to nobody alive.
"""

import contextlib
import os
import signal
from dataclasses import dataclass, field
from pathlib import Path

import docker
from docker.errors import DockerException, NotFound

from slambed.engines.base import LABEL, stat_fields
from slambed.engines.cgroups import CgroupMaker, remove
from slambed.engines.helper import is_root

OWNER_VARIABLE = "SLAMBED_HARNESS"
"""Environment of every child: number and start time of the harness process it belongs to."""


@dataclass
class Reaped:
    """What was found and removed."""

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


def mark_children() -> None:
    """From here on every child process can be recognised as ours."""
    os.environ[OWNER_VARIABLE] = f"{os.getpid()}:{start_time(os.getpid())}"


def start_time(pid: int) -> int | None:
    """Kernel clock ticks at which a process began; with the number it names the process."""
    fields = stat_fields(pid)
    return None if fields is None else int(fields[19])


def reap() -> Reaped:
    """Removes all leftovers of dead harness processes."""
    reaped = Reaped()
    _reap_containers(reaped)
    _reap_processes(reaped)
    # Others may not remove groups; their nodes are containers, which take their groups along.
    for folder in CgroupMaker().leftovers() if is_root() else ():
        if remove(folder) and folder.name != LABEL:
            reaped.groups.append(folder)
    return reaped


def _reap_containers(reaped: Reaped) -> None:
    try:
        client = docker.from_env(timeout=20)
        containers = client.containers.list(all=True, filters={"label": LABEL})
    except DockerException:
        return  # No daemon, no containers.
    for container in containers:
        with contextlib.suppress(NotFound):
            container.remove(force=True, v=True)
            reaped.containers.append(str(container.name))
    client.close()


def _reap_processes(reaped: Reaped) -> None:
    marker = f"{OWNER_VARIABLE}=".encode()
    for folder in Path("/proc").glob("[0-9]*"):
        pid = int(folder.name)
        try:
            environment = (folder / "environ").read_bytes().split(b"\0")
        except OSError:
            continue
        owners = [item.removeprefix(marker) for item in environment if item.startswith(marker)]
        if not owners or pid == os.getpid():
            continue
        owner, _, began = owners[0].decode(errors="replace").partition(":")
        alive = owner.isdigit() and str(start_time(int(owner))) == began
        if not alive:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL)
                reaped.processes.append(pid)
