# SPDX-License-Identifier: Apache-2.0
"""External faults of a campaign: processes that are killed, stopped or terminated; a disk that is
full, without inodes, or with a read-only folder.

All processes of a campaign have a token in their environment, which identifies them and protects
all others.
"""

import contextlib
import os
import random
import signal
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from slambed.engines import sidecar
from slambed.link import link_helper

TOKEN = "SLAMBED_CHAOS"
KILL, TERMINATE, STOP = "kill -9", "SIGTERM", "SIGSTOP"
SIGNALS = {KILL: signal.SIGKILL, TERMINATE: signal.SIGTERM, STOP: signal.SIGSTOP}
FULL, NO_INODES, READ_ONLY = "disk full", "no inodes", "folder read-only"
ON_DISK = (FULL, NO_INODES, READ_ONLY)
IN_DOCKER = ("docker kill", "docker pause", "docker rm")
CLOCK = ("clock forward", "clock back")
LEAST_FILL = 4096


def processes(token: str, group: str = "") -> list[psutil.Process]:
    """Returns all live processes of this campaign. Processes in containers have no token, but
    are in cgroups below the one of this name."""
    found = []
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error):
            if process.status() == psutil.STATUS_ZOMBIE or process.pid == os.getpid():
                continue
            if process.environ().get(TOKEN) == token or (group and _is_in(process, group)):
                found.append(process)
    return found


def _is_in(process: psutil.Process, group: str) -> bool:
    with contextlib.suppress(OSError):
        return f"/{group}/" in Path(f"/proc/{process.pid}/cgroup").read_text()
    return False


MARKS = {
    sidecar.__name__: "sampler",
    link_helper.__name__: "helper container",
    "slambed-relay": "relay",
    "slambed-pace": "metronome",
    "slambed-sim": "node",
    "-m dask worker": "Dask worker",
    "-m dask scheduler": "Dask scheduler",
    "multiprocessing.resource_tracker": "resource tracker",
}
"""Part of a command line -> role of the process."""


def role_of(process: psutil.Process, harness: int) -> str:
    """Returns the role of a process as faults name it; empty for none."""
    if process.pid == harness:
        return "harness"
    command = " ".join(process.cmdline())
    if process.name() == "docker":
        return "docker client"
    if "slambed-node" in command and "--role" in command:
        return f"{command.rpartition('--role ')[2].split()[0]} node"
    if "multiprocessing.forkserver" in command:
        # Worker processes are forked from the server and keep its command line.
        parent = process.parent()
        forked = parent is not None and "multiprocessing.forkserver" in " ".join(parent.cmdline())
        return "worker" if forked or process.ppid() != harness else "fork server"
    return next((role for mark, role in MARKS.items() if mark in command), "")


@dataclass(frozen=True)
class Fault:
    """An action and its target."""

    act: str
    target: str = ""
    """A role; empty for disk and clock."""

    def __str__(self) -> str:
        return f"{self.act} {self.target}".strip()


@dataclass
class Disk:
    """The results' disk: a separate small file system, or (without root) a plain folder."""

    folder: Path
    own: bool
    kibibytes: int = 98304
    inodes: int = 6000
    _fillers: list[Path] = field(default_factory=list)
    _fixed: list[Path] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.folder.mkdir(parents=True)
        if self.own:
            options = f"size={self.kibibytes}k,nr_inodes={self.inodes}"
            _mount("-t", "tmpfs", "-o", options, "slambed-chaos", str(self.folder))

    def remove(self) -> None:
        """Unmounts and removes it."""
        self.heal()
        if self.own:
            subprocess.run(["umount", "--lazy", str(self.folder)], check=True)

    def strike(self, act: str, rng: random.Random) -> bool:
        """Damages it; False if that was not possible."""
        if not self.own:
            return False
        strikes: dict[str, Callable[[random.Random], bool]] = {
            FULL: self._fill,
            NO_INODES: self._use_inodes,
            READ_ONLY: self._fix,
        }
        return strikes[act](rng)

    def _fill(self, rng: random.Random) -> bool:
        filler = self.folder / f".filler{len(self._fillers)}"
        self._fillers.append(filler)
        size = self.kibibytes << 10
        with filler.open("wb") as out:
            while size >= LEAST_FILL:
                try:
                    os.posix_fallocate(out.fileno(), out.seek(0, os.SEEK_END), size)
                except OSError:
                    size //= 2
        return os.statvfs(self.folder).f_bavail == 0

    def _use_inodes(self, rng: random.Random) -> bool:
        many = self.folder / f".many{len(self._fillers)}"
        self._fillers.append(many)
        many.mkdir()
        with contextlib.suppress(OSError):
            for number in range(self.inodes):
                (many / str(number)).touch()
        return os.statvfs(self.folder).f_favail == 0

    def _fix(self, rng: random.Random) -> bool:
        folders = [p for p in (self.folder, *self.folder.glob("*/")) if not p.is_symlink()]
        folder = rng.choice(sorted(folders))
        done = subprocess.run(["chattr", "+i", str(folder)], capture_output=True, check=False)
        if done.returncode == 0:
            self._fixed.append(folder)
        return done.returncode == 0

    def heal(self) -> None:
        """Restores it."""
        for folder in self._fixed:
            subprocess.run(["chattr", "-i", str(folder)], capture_output=True, check=False)
        for filler in self._fillers:
            if filler.is_dir():
                for path in filler.iterdir():
                    path.unlink()
                filler.rmdir()
            else:
                filler.unlink(missing_ok=True)
        self._fixed, self._fillers = [], []


def _mount(*arguments: str) -> None:
    subprocess.run(["mount", *arguments], check=True)


def strike(
    fault: Fault, alive: list[psutil.Process], harness: int, rng: random.Random
) -> psutil.Process | None:
    """Acts on one of the processes with this role; None if there is none."""
    found = []
    for process in alive:
        with contextlib.suppress(psutil.Error):
            if role_of(process, harness) == fault.target:
                found.append(process)
    if not found:
        return None
    victim = rng.choice(sorted(found, key=lambda process: process.pid))
    return victim if signal_to(victim, fault.act) else None


def signal_to(victim: psutil.Process, act: str) -> bool:
    """Returns False if it has gone."""
    try:
        victim.send_signal(SIGNALS[act])
    except psutil.Error:
        return False
    return True


def wake(process: psutil.Process) -> None:
    """Continues a process after SIGSTOP."""
    with contextlib.suppress(psutil.Error):
        process.send_signal(signal.SIGCONT)
