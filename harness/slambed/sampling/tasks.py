# SPDX-License-Identifier: Apache-2.0
"""Kernel facts about the threads of a process: names, and time spent waiting for a CPU."""

import os
from pathlib import Path

from slambed.sampling.cgroup import GroupProcesses
from slambed.sampling.kept_files import KeptFiles

NS_PER_S = 1e9


def thread_ids(pid: int) -> list[int]:
    """Returns the sorted thread ids of a process; empty when it has gone."""
    try:
        # Called 10 times per second: Path.iterdir would dominate the sampler's cost.
        return sorted(map(int, os.listdir(f"/proc/{pid}/task")))  # noqa: PTH208
    except OSError:
        return []


def threads_of(pid: int, group: GroupProcesses | None) -> list[tuple[int, int]]:
    """Returns (process, thread) pairs of a process, or of all processes of its cgroup."""
    pids = [pid] if group is None else group.pids()
    return [(each, tid) for each in pids for tid in thread_ids(each)]


def thread_name(pid: int, tid: int) -> str | None:
    """Returns the name that the thread gave itself (up to 15 characters); None when it has gone."""
    try:
        return Path(f"/proc/{pid}/task/{tid}/comm").read_text(errors="replace").strip()
    except OSError:
        return None


class RunQueueDelay:
    """Time in which the threads of a process were runnable but not running, since they began.

    This is the second number of /proc/<pid>/task/<tid>/schedstat. A thread that has ended keeps its
    last value.
    """

    def __init__(self, pid: int, group: GroupProcesses | None = None) -> None:
        """With `group`, all its processes are counted instead of only `pid`."""
        self._pid = pid
        self._group = group
        self._files = KeptFiles()
        self._open: set[str] = set()
        self._delay_ns: dict[int, int] = {}

    def follow(self, pid: int) -> None:
        """Also counts the threads of another process from now on."""
        self._pid = pid

    def seconds(self) -> float | None:
        """Returns the sum over all threads so far; None if the kernel does not report it."""
        paths = {
            f"/proc/{pid}/task/{tid}/schedstat": tid
            for pid, tid in threads_of(self._pid, self._group)
        }
        # Files of ended threads would add up: some programs start threads for every frame.
        for path in self._open - paths.keys():
            self._files.forget(path)
        self._open = set(paths)
        for path, tid in paths.items():
            try:
                self._delay_ns[tid] = int(self._files.read(path).split()[1])
            except (OSError, IndexError):
                self._files.forget(path)
        return sum(self._delay_ns.values()) / NS_PER_S if self._delay_ns else None

    def close(self) -> None:
        self._files.close()


class Pressure:
    """Pressure stall information (PSI) of the CPU: time in which some thread waited for one."""

    def __init__(self, group: Path | None) -> None:
        """Uses the file of a v2 cgroup if it exists, otherwise that of the whole host."""
        own = group / "cpu.pressure" if group is not None else None
        self._path = str(own) if own is not None and own.exists() else "/proc/pressure/cpu"
        self._files = KeptFiles()

    def seconds(self) -> float | None:
        """Returns the cumulative time; None if the kernel has no PSI."""
        try:
            line = self._files.read(self._path).splitlines()[0]
            return int(line.rpartition("total=")[2]) / 1e6
        except (OSError, IndexError, ValueError):
            return None

    def close(self) -> None:
        self._files.close()
