# SPDX-License-Identifier: Apache-2.0
"""Reads the cgroup of a process: usage, throttling and limits; cgroup v1, v2 or both."""

from dataclasses import dataclass
from pathlib import Path

from slambed.errors import environment_error
from slambed.sampling.kept_files import KeptFiles

CONTROLLERS = ("cpu", "cpuacct", "cpuset", "memory")
NS_PER_S = 1e9
US_PER_S = 1e6
# cgroup v1 says "no limit" with a number near 2^63, rounded to pages.
V1_NO_LIMIT = 1 << 62


@dataclass(frozen=True)
class Usage:
    """Counters at one moment; all but the memory are cumulative."""

    cpu_s: float
    memory_bytes: int
    """Anonymous memory only, without the page cache of the mapped sequence."""
    throttled_s: float
    throttled_periods: int
    periods: int


@dataclass(frozen=True)
class Granted:
    """Limits as the kernel reports them; None = no limit."""

    cpus: str
    quota_cores: float | None
    period_ms: float
    memory_mb: float | None


@dataclass(frozen=True)
class CgroupPaths:
    """Folder of each controller for one cgroup."""

    folders: dict[str, Path]
    """Controller -> folder, for controllers mounted as cgroup v1."""
    unified: Path | None
    """Folder in the v2 hierarchy, if mounted."""

    def v1(self, controller: str) -> Path | None:
        """Returns the folder of a v1 controller."""
        return self.folders.get(controller)


@dataclass(frozen=True)
class Mount:
    """One mounted cgroup hierarchy."""

    controllers: frozenset[str]
    """Only controllers that we use."""
    point: Path
    root: str
    """The cgroup that is visible at `point`; inside a container it is not `/`."""
    is_unified: bool = False
    """cgroup v2."""

    def folder(self, group: str) -> Path:
        """Returns the folder of a cgroup listed in /proc/<pid>/cgroup."""
        inside = group.removeprefix(self.root) if self.root != "/" else group
        return self.point / inside.lstrip("/")


def mounts(mountinfo: Path = Path("/proc/self/mountinfo")) -> list[Mount]:
    """Returns the visible cgroup hierarchies with a controller that we use."""
    return [m for m in hierarchies(mountinfo) if m.is_unified or m.controllers]


def hierarchies(mountinfo: Path = Path("/proc/self/mountinfo")) -> list[Mount]:
    """Returns all cgroup hierarchies; a container has a cgroup in each one."""
    found: list[Mount] = []
    for line in mountinfo.read_text().splitlines():
        before, _, after = line.partition(" - ")
        _, _, _, root, point, *_ = before.split()
        kind, _, options = after.split(" ", 2)
        if kind == "cgroup2":
            found.append(Mount(frozenset(), Path(point), root, is_unified=True))
        elif kind == "cgroup":
            words = options.replace(" ", ",").split(",")
            ours = frozenset(words).intersection(CONTROLLERS)
            found.append(Mount(ours, Path(point), root))
    return found


def mounted(mountinfo: Path = Path("/proc/self/mountinfo")) -> tuple[dict[str, Path], Path | None]:
    """Returns the mount points of the v1 controllers and of the v2 tree."""
    v1: dict[str, Path] = {}
    v2: Path | None = None
    for mount in mounts(mountinfo):
        for controller in mount.controllers:
            v1.setdefault(controller, mount.point)
        if mount.is_unified:
            v2 = v2 or mount.point
    return v1, v2


def version() -> str:
    """Returns `v1`, `v2` or `none`: the hierarchy that has the cpu controller."""
    v1, v2 = mounted()
    if "cpu" in v1:
        return "v1"
    if v2 is not None and "cpu" in (v2 / "cgroup.controllers").read_text().split():
        return "v2"
    return "none"


def paths_of(pid: int) -> CgroupPaths:
    """Returns the cgroups of a process."""
    try:
        lines = Path(f"/proc/{pid}/cgroup").read_text().splitlines()
    except OSError:
        raise environment_error(f"process {pid} is gone: no /proc/{pid}/cgroup") from None
    found = mounts()
    folders: dict[str, Path] = {}
    unified: Path | None = None
    for line in lines:
        _, names, group = line.split(":", 2)
        for mount in found:
            for name in mount.controllers.intersection(names.split(",")):
                folders.setdefault(name, mount.folder(group))
            if not names and mount.is_unified:
                unified = unified or mount.folder(group)
    return CgroupPaths(folders, unified)


class GroupProcesses:
    """Lists the processes of a node's cgroup, even if some threads were moved to others."""

    def __init__(self, paths: CgroupPaths) -> None:
        # Threads have their own cgroups below the v1 cpu controller. The other v1 controllers and a
        # threaded v2 tree keep all processes of the node in one cgroup.
        folders = (paths.v1("memory"), paths.v1("cpuset"), paths.unified, paths.v1("cpu"))
        self._file = next(f"{folder}/cgroup.procs" for folder in folders if folder is not None)

    def pids(self) -> list[int]:
        """Returns sorted process ids; empty when the cgroup is gone."""
        try:
            # Opened each time: v1 returns a cached list, up to a second old, for an open file.
            content = Path(self._file).read_text()
        except OSError:
            return []
        return sorted(int(pid) for pid in content.split() if pid != "0")


class CgroupReader:
    """Reads the counters and limits of one cgroup."""

    def __init__(self, paths: CgroupPaths) -> None:
        self.paths = paths
        self._files = KeptFiles()
        if paths.v1("cpuacct") is None and paths.unified is None:
            raise environment_error("no cgroup with a CPU counter is mounted under /sys/fs/cgroup")
        accounting, memory = paths.v1("cpuacct"), paths.v1("memory") or paths.unified
        stat_in = (paths.v1("cpu") or accounting) if accounting is not None else paths.unified
        self._usage_file = str(accounting / "cpuacct.usage") if accounting is not None else None
        self._stat_file = f"{stat_in}/cpu.stat"
        has_memory = memory is not None and (memory / "memory.stat").exists()
        self._memory_file = f"{memory}/memory.stat" if has_memory else None

    def usage(self) -> Usage:
        """Returns the current counters. Raises OSError when the cgroup is gone."""
        stat = self._table(self._stat_file)
        if self._usage_file is not None:
            cpu_s = int(self._files.read(self._usage_file)) / NS_PER_S
            throttled_s = stat.get("throttled_time", 0) / NS_PER_S
        else:
            cpu_s = stat.get("usage_usec", 0) / US_PER_S
            throttled_s = stat.get("throttled_usec", 0) / US_PER_S
        return Usage(
            cpu_s=cpu_s,
            memory_bytes=self._memory(),
            throttled_s=throttled_s,
            throttled_periods=stat.get("nr_throttled", 0),
            periods=stat.get("nr_periods", 0),
        )

    def _memory(self) -> int:
        if self._memory_file is None:
            return 0
        stat = self._table(self._memory_file)
        if self.paths.v1("memory") is not None:
            return stat.get("total_rss", stat.get("rss", 0))
        return stat.get("anon", 0)

    def _table(self, path: str) -> dict[str, int]:
        return _parsed(self._files.read(path))

    def close(self) -> None:
        """Closes the files that it keeps open."""
        self._files.close()

    def oom_kills(self) -> int:
        """Returns the number of processes in the cgroup killed for exceeding the memory limit."""
        if (folder := self.paths.v1("memory")) is not None:
            return _table(folder / "memory.oom_control").get("oom_kill", 0)
        if self.paths.unified is not None and (self.paths.unified / "memory.events").exists():
            return _table(self.paths.unified / "memory.events").get("oom_kill", 0)
        return 0

    def granted(self) -> Granted:
        """Returns the limits in force."""
        if (cpu := self.paths.v1("cpu")) is not None:
            period_us = int((cpu / "cpu.cfs_period_us").read_text())
            quota_us = int((cpu / "cpu.cfs_quota_us").read_text())
        else:
            # The v2 root cgroup has no cpu.max file and no limit.
            words = _text(self.paths.unified, "cpu.max", "max 100000").split()
            quota_us = -1 if words[0] == "max" else int(words[0])
            period_us = int(words[1])
        return Granted(
            cpus=self._cpus(),
            quota_cores=None if quota_us < 0 else quota_us / period_us,
            period_ms=period_us / 1000,
            memory_mb=self._memory_limit(),
        )

    def _cpus(self) -> str:
        if (folder := self.paths.v1("cpuset")) is not None:
            return (folder / "cpuset.effective_cpus").read_text().strip()
        return _text(self.paths.unified, "cpuset.cpus.effective", "")

    def _memory_limit(self) -> float | None:
        if (folder := self.paths.v1("memory")) is not None:
            limit = int((folder / "memory.limit_in_bytes").read_text())
            return None if limit > V1_NO_LIMIT else limit / 2**20
        text = _text(self.paths.unified, "memory.max", "max")
        return None if text == "max" else int(text) / 2**20


def _table(path: Path) -> dict[str, int]:
    return _parsed(path.read_text())


def _parsed(text: str) -> dict[str, int]:
    rows = (line.split() for line in text.splitlines())
    return {row[0]: int(row[1]) for row in rows if len(row) == 2}


def _text(folder: Path | None, name: str, otherwise: str) -> str:
    if folder is None or not (folder / name).exists():
        return otherwise
    return (folder / name).read_text().strip()
