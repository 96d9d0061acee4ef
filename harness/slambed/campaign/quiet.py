# SPDX-License-Identifier: Apache-2.0
"""Measures the load on a host before live runs: steal time and CPU use of other programs."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import psutil

LOOK_S = 2.0
MOST_STEAL_PERCENT = 1.0
MOST_BUSY_PERCENT = 10.0
"""Above these limits stalls of tens of milliseconds are likely in every run
(docs/explanation/limits.md)."""


@dataclass(frozen=True)
class Load:
    """Percentages of the CPU time of all CPUs, while none of our runs was active."""

    steal_percent: float
    busy_percent: float

    @property
    def quiet(self) -> bool:
        """Whether runs started now will probably be valid."""
        calm = self.busy_percent <= MOST_BUSY_PERCENT
        return calm and self.steal_percent <= MOST_STEAL_PERCENT

    def __str__(self) -> str:
        word = "quiet" if self.quiet else "not quiet, runs may have to be executed again"
        return (
            f"the host is {word}: {self.steal_percent:.1f} % steal, {self.busy_percent:.0f} % of "
            "its CPU time is taken by others"
        )


def look(seconds: float = LOOK_S) -> Load:
    """Measures the load over this time."""
    share = psutil.cpu_times_percent(interval=seconds)
    steal = float(getattr(share, "steal", 0.0))
    waiting = float(getattr(share, "iowait", 0.0))
    return Load(steal, max(0.0, 100.0 - share.idle - waiting - steal))


def wait_for_quiet(
    limit_s: float,
    stop: threading.Event,
    notify: Callable[[str], None],
    meanwhile: Callable[[], object] = lambda: None,
) -> Load:
    """Measures repeatedly until the host is quiet, the time limit is reached or `stop` is set;
    returns the last load.

    `notify` is called when waiting begins. `meanwhile` is called repeatedly while waiting; an
    exception ends the wait.
    """
    deadline = time.monotonic() + limit_s
    load = look()
    if not load.quiet and limit_s > 0:
        notify(f"{load}; waiting up to {limit_s / 60:.0f} min for it to become quiet")
    while not load.quiet and time.monotonic() < deadline and not stop.is_set():
        meanwhile()
        load = look()
    return load
