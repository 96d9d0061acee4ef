# SPDX-License-Identifier: Apache-2.0
"""Limits the CPU time of a child, so that a slow or busy host does not change the outcome."""

import time
from dataclasses import dataclass, field

import psutil

from slambed.errors import PassingError

IDLE_LIMIT_S = 300.0
"""Wall-clock time; with thirty jobs on one core each still gets 10 s of CPU time."""
IDLE_CPU_S = 0.5
"""A process that used less CPU time within IDLE_LIMIT_S is idle."""


@dataclass
class CpuWatch:
    """Watches a child that has not been waited for, so that its process id cannot be reused."""

    pid: int
    name: str
    limit_s: float
    """CPU time of all its threads, in user and kernel mode."""
    idle_limit_s: float = IDLE_LIMIT_S
    _since_s: float = field(default_factory=time.monotonic)
    _cpu_then_s: float = 0.0

    def spent(self) -> bool:
        """Returns whether it exceeded its CPU time. Raises PassingError if it is idle: a process
        that is stopped, starved or waiting says nothing about its computing time."""
        times = psutil.Process(self.pid).cpu_times()
        cpu_s = times.user + times.system
        if cpu_s > self.limit_s:
            return True
        now_s = time.monotonic()
        if cpu_s - self._cpu_then_s >= IDLE_CPU_S:
            self._since_s, self._cpu_then_s = now_s, cpu_s
        elif now_s - self._since_s > self.idle_limit_s:
            raise PassingError(
                f"{self.name} computed {cpu_s - self._cpu_then_s:.1f} s in {self.idle_limit_s:.0f} "
                "s: it waits, was stopped, or the host leaves it no CPU time"
            )
        return False
