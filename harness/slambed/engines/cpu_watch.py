# SPDX-License-Identifier: Apache-2.0
"""How long a child may compute: CPU time, so that a slow or busy host changes no outcome."""

import time
from dataclasses import dataclass, field

import psutil

from slambed.errors import PassingError

IDLE_LIMIT_S = 300.0
"""Wall clock. Thirty jobs on one core still leave each ten seconds of it."""
IDLE_CPU_S = 0.5
"""A process that took less CPU time within IDLE_LIMIT_S does not compute."""


@dataclass
class CpuWatch:
    """Looks at a child that nobody has waited for yet: its number is surely its own."""

    pid: int
    name: str
    limit_s: float
    """CPU time of all its threads, in user and kernel mode."""
    idle_limit_s: float = IDLE_LIMIT_S
    _since_s: float = field(default_factory=time.monotonic)
    _cpu_then_s: float = 0.0

    def spent(self) -> bool:
        """Whether it computed longer than it may. PassingError when it stands still: stopped, shut
        out by the host or waiting for something says nothing about how much it had to compute."""
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
