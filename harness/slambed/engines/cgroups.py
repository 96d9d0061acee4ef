# SPDX-License-Identifier: Apache-2.0
"""Creates and removes the cgroups of the local engine: slambed/<run key>-<role>."""

import contextlib
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

from slambed.engines.base import LABEL
from slambed.errors import environment_error
from slambed.sampling.cgroup import CONTROLLERS, CgroupPaths, hierarchies, mounted
from slambed.spec.device import Limits

V1_LARGEST_SHARES, V2_LARGEST_WEIGHT = 262144, 10000
"""Weight of all nodes together against the rest of the host: a run has priority."""
V2_CONTROLLERS = ("cpu", "cpuset", "memory")
REMOVE_TRIES = 100
REMOVE_PAUSE_S = 0.02


class CgroupMaker:
    """cgroups below the given mounts (by default those of this host)."""

    def __init__(
        self, v1: dict[str, Path] | None = None, v2: Path | None = None, found: bool = True
    ) -> None:
        self.v1, self.v2 = mounted() if found else (v1 or {}, v2)
        self._everywhere = {*self.v1.values(), *([self.v2] if self.v2 else [])}
        if found:
            self._everywhere |= {mount.point for mount in hierarchies()}

    @property
    def is_v1(self) -> bool:
        """True when the cpu controller is mounted as cgroup v1."""
        return "cpu" in self.v1

    def make(self, name: str, limits: Limits, cpus: list[int]) -> CgroupPaths:
        """Creates an empty cgroup with these limits."""
        try:
            return (
                self._make_v1(name, limits, cpus)
                if self.is_v1
                else self._make_v2(name, limits, cpus)
            )
        except OSError as error:
            raise environment_error(
                f"cannot set the limits of a node: {error.strerror}, {error.filename}; "
                "run as root, on a host where cgroups can be written"
            ) from None

    def _make_v1(self, name: str, limits: Limits, cpus: list[int]) -> CgroupPaths:
        folders: dict[str, Path] = {}
        for controller in CONTROLLERS:
            if (mount := self.v1.get(controller)) is None:
                continue
            folder = mount / LABEL / name
            folder.mkdir(parents=True, exist_ok=True)
            folders[controller] = folder
        if "cpuset" in folders:
            _fill_cpuset(folders["cpuset"].parent, None)
            _fill_cpuset(folders["cpuset"], cpus)
        period_us, quota_us = _quota(limits)
        (folders["cpu"] / "cpu.cfs_period_us").write_text(str(period_us))
        (folders["cpu"] / "cpu.cfs_quota_us").write_text(str(quota_us or -1))
        if limits.memory_mb is not None and "memory" in folders:
            bytes_text = str(limits.memory_mb * 2**20)
            (folders["memory"] / "memory.limit_in_bytes").write_text(bytes_text)
        paths = CgroupPaths(folders, None)
        put_before_others(paths)
        return paths

    def _make_v2(self, name: str, limits: Limits, cpus: list[int]) -> CgroupPaths:
        if self.v2 is None:
            raise environment_error("no cgroup tree is mounted under /sys/fs/cgroup")
        parent = self.v2 / LABEL
        parent.mkdir(exist_ok=True)
        folder = parent / name
        # A kernel for one CPU has no cpuset; a missing limit is noticed when limits are read back.
        offered = (self.v2 / "cgroup.controllers").read_text().split()
        for level in (self.v2, parent):
            for controller in V2_CONTROLLERS:
                if controller in offered:
                    (level / "cgroup.subtree_control").write_text(f"+{controller}")
        folder.mkdir(exist_ok=True)
        paths = CgroupPaths({}, folder)
        put_before_others(paths)
        period_us, quota_us = _quota(limits)
        (folder / "cpu.max").write_text(f"{quota_us or 'max'} {period_us}")
        if "cpuset" in offered:
            (folder / "cpuset.cpus").write_text(",".join(map(str, cpus)))
        if limits.memory_mb is not None:
            (folder / "memory.max").write_text(str(limits.memory_mb * 2**20))
        return paths

    def leftovers(self) -> Iterator[Path]:
        """Yields all our cgroup folders, children before parents."""
        for mount in sorted(self._everywhere):
            top = mount / LABEL
            if top.is_dir():
                yield from below(top)
                yield top


def put_before_others(paths: CgroupPaths) -> None:
    """Gives the parent cgroup of all nodes the largest weight, if this node is in it."""
    for folder, file, largest in (
        (paths.v1("cpu"), "cpu.shares", V1_LARGEST_SHARES),
        (paths.unified, "cpu.weight", V2_LARGEST_WEIGHT),
    ):
        if folder is not None and folder.parent.name == LABEL:
            share = folder.parent / file
            # On a hybrid host the v2 tree has no cpu controller.
            if share.exists():
                share.write_text(str(largest))


def entry_files(paths: CgroupPaths) -> list[Path]:
    """Returns the files to which a process writes its id to join."""
    folders = {*paths.folders.values(), *([paths.unified] if paths.unified else [])}
    return sorted(folder / "cgroup.procs" for folder in folders)


def below(folder: Path) -> list[Path]:
    """Returns the cgroups inside a cgroup, children before parents."""
    found = [path for path in folder.rglob("*") if path.is_dir()]
    return sorted(found, key=lambda path: (-len(path.parts), path))


def remove(folder: Path) -> bool:
    """Kills the remaining processes in a cgroup and its children and removes it; False if the
    kernel refuses."""
    if folder.is_dir() and not all([remove(child) for child in below(folder)]):
        return False
    for _ in range(REMOVE_TRIES):
        try:
            folder.rmdir()
            return True
        except FileNotFoundError:
            return True
        except OSError:
            _kill_members(folder)
            time.sleep(REMOVE_PAUSE_S)
    return False


def _kill_members(folder: Path) -> None:
    with contextlib.suppress(OSError):
        for pid in map(int, (folder / "cgroup.procs").read_text().split()):
            # 0 stands for a process in another PID namespace; kill(0) would signal our own group.
            if pid > 0:
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.kill(pid, signal.SIGKILL)


def _quota(limits: Limits) -> tuple[int, int | None]:
    period_us = round(limits.period_ms * 1000)
    if limits.quota_cores is None:
        return period_us, None
    return period_us, round(limits.quota_cores * period_us)


def _fill_cpuset(folder: Path, cpus: list[int] | None) -> None:
    """Both files must be written before a v1 cpuset accepts a process; mems comes first."""
    above = folder.parent
    (folder / "cpuset.mems").write_text((above / "cpuset.mems").read_text())
    text = ",".join(map(str, cpus)) if cpus else (above / "cpuset.cpus").read_text()
    (folder / "cpuset.cpus").write_text(text)
