# SPDX-License-Identifier: Apache-2.0
"""Puts every thread of a node into its own cgroup, so that none is faster than the device.

A cgroup's quota limits the sum over its threads, so one busy thread could use all of it. New
threads are found in /proc and moved to `<cgroup of the node>/thread-<number>`.
"""

import contextlib
import errno
from dataclasses import dataclass, field
from math import fsum
from pathlib import Path

from slambed.errors import environment_error
from slambed.sampling.cgroup import CgroupPaths, GroupProcesses
from slambed.sampling.kept_files import KeptFiles
from slambed.sampling.tasks import thread_name, threads_of

PREFIX = "thread-"
GONE = (errno.ESRCH, errno.ENOENT, errno.ENODEV)
NS_PER_S = 1e9
US_PER_S = 1e6


@dataclass
class CappedThread:
    """One thread and its granted cap."""

    pid: int
    tid: int
    folder: Path
    stat_file: str
    name: str = ""
    cores: float | None = None
    """Read back from the kernel; None = no cap."""
    period_ms: float = 0.0
    throttled_s: float = 0.0
    throttled_periods: int = 0
    alive: bool = True


@dataclass
class ThreadCaps:
    """The capped threads of one process."""

    pid: int
    """0 once it has ended, because its process id may be reused."""
    paths: CgroupPaths
    cores: float
    period_ms: float
    group: GroupProcesses | None = None
    """For a node that may consist of several processes: its cgroup's processes."""
    threads: dict[int, CappedThread] = field(default_factory=dict)
    _files: KeptFiles = field(default_factory=KeptFiles)

    @property
    def _group(self) -> Path:
        group = self.paths.v1("cpu") or self.paths.unified
        assert group is not None
        return group

    @property
    def _is_v1(self) -> bool:
        return self.paths.v1("cpu") is not None

    def scan(self) -> None:
        """Caps new threads and removes those that have ended."""
        present = {tid: pid for pid, tid in threads_of(self.pid, self.group)} if self.pid else {}
        if not present:
            self.pid = 0
        for tid, pid in present.items():
            known = self.threads.get(tid)
            if known is None or not known.alive:
                self._cap(pid, tid)
        for tid in self.threads.keys() - present.keys():
            self._forget(self.threads[tid])

    def read_names(self) -> None:
        """Reads names again: threads set them shortly after their start, and the program
        replaces the shell of the start barrier."""
        for thread in self.threads.values():
            thread.name = thread_name(thread.pid, thread.tid) or thread.name

    def _cap(self, pid: int, tid: int) -> None:
        folder = self._group / f"{PREFIX}{tid}"
        try:
            folder.mkdir(exist_ok=True)
            (self._limit_v1 if self._is_v1 else self._limit_v2)(folder)
            members = "tasks" if self._is_v1 else "cgroup.threads"
            (folder / members).write_text(str(tid))
        except OSError as error:
            if error.errno in GONE:
                # The thread or the whole cgroup has ended in the meantime.
                with contextlib.suppress(OSError):
                    folder.rmdir()
                return
            raise environment_error(
                f"cannot cap a thread: {error.strerror}, {error.filename}; run as root, on a host "
                "where cgroups can be written"
            ) from None
        thread = CappedThread(pid, tid, folder, f"{folder}/cpu.stat")
        thread.cores, thread.period_ms = self._granted(folder)
        thread.name = thread_name(pid, tid) or ""
        self.threads[tid] = thread

    def _limit_v1(self, folder: Path) -> None:
        period_us, quota_us = self._quota()
        (folder / "cpu.cfs_period_us").write_text(str(period_us))
        (folder / "cpu.cfs_quota_us").write_text(str(quota_us))

    def _limit_v2(self, folder: Path) -> None:
        # The type first: with a threaded child the node's cgroup may keep its processes and still
        # delegate the cpu controller.
        (folder / "cgroup.type").write_text("threaded")
        (folder.parent / "cgroup.subtree_control").write_text("+cpu")
        period_us, quota_us = self._quota()
        (folder / "cpu.max").write_text(f"{quota_us} {period_us}")

    def _quota(self) -> tuple[int, int]:
        period_us = round(self.period_ms * 1000)
        return period_us, round(self.cores * period_us)

    def _granted(self, folder: Path) -> tuple[float | None, float]:
        if self._is_v1:
            period_us = int((folder / "cpu.cfs_period_us").read_text())
            quota = (folder / "cpu.cfs_quota_us").read_text().strip()
        else:
            quota, period = (folder / "cpu.max").read_text().split()
            period_us = int(period)
        cores = None if quota in ("-1", "max") else int(quota) / period_us
        return cores, period_us / 1000

    def members(self) -> dict[int, list[int]]:
        """Returns the threads in each of our cgroups, as the kernel reports them."""
        name = "tasks" if self._is_v1 else "cgroup.threads"
        found = {}
        for tid, thread in self.threads.items():
            with contextlib.suppress(OSError):
                found[tid] = [int(text) for text in (thread.folder / name).read_text().split()]
        return found

    def read_throttling(self) -> tuple[float, int]:
        """Returns seconds and periods of throttling by the caps, over all threads so far."""
        for thread in self.threads.values():
            if thread.alive:
                self._read(thread)
        threads = self.threads.values()
        return fsum(t.throttled_s for t in threads), sum(t.throttled_periods for t in threads)

    def _read(self, thread: CappedThread) -> None:
        with contextlib.suppress(OSError):
            rows = self._files.read(thread.stat_file).splitlines()
            stat = {key: int(value) for key, _, value in (row.partition(" ") for row in rows)}
            if self._is_v1:
                thread.throttled_s = stat.get("throttled_time", 0) / NS_PER_S
            else:
                thread.throttled_s = stat.get("throttled_usec", 0) / US_PER_S
            thread.throttled_periods = stat.get("nr_throttled", 0)

    def _forget(self, thread: CappedThread) -> None:
        if not thread.alive:
            return
        self._read(thread)
        self._files.forget(thread.stat_file)
        with contextlib.suppress(OSError):
            thread.folder.rmdir()
            thread.alive = False
        thread.alive = thread.alive and thread.folder.exists()

    def release(self) -> None:
        """Moves running threads back to the node's cgroup and removes ours."""
        members = "tasks" if self._is_v1 else "cgroup.threads"
        for thread in self.threads.values():
            if thread.alive:
                self._read(thread)
                # Most likely removed together with its process.
                with contextlib.suppress(OSError):
                    (self._group / members).write_text(str(thread.tid))
                self._forget(thread)
        self._files.close()
