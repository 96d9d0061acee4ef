# SPDX-License-Identifier: Apache-2.0
"""A process that only sleeps and measures how late it wakes up: concurrent tests are late likewise.
It needs only the standard library. It is no thread of the tests, because threads of one Python
process block each other, which is not the host's fault.

For each input line it writes one line of JSON with all measurements since the last one.
"""

import json
import os
import select
import sys
import time
from pathlib import Path

SLEEP_S = 0.01
LOOK_S = 1.0
TICKS_PER_S = os.sysconf("SC_CLK_TCK")
PRESSURE = Path("/proc/pressure/cpu")
STEAL = 8
"""Position in the first line of /proc/stat (proc(5))."""


def _stolen_s() -> float:
    """Returns the total steal time, averaged over the CPUs."""
    with Path("/proc/stat").open() as file:
        return int(file.readline().split()[STEAL]) / TICKS_PER_S / (os.cpu_count() or 1)


def _waited_s() -> float | None:
    """Returns the total time in which any process waited for a CPU; not every kernel reports it."""
    try:
        with PRESSURE.open() as file:
            return int(file.readline().rpartition("=")[2]) / 1e6
    except OSError:
        return None


class Looks:
    """One measurement per second, and one for each request."""

    def __init__(self) -> None:
        self.reported: list[dict[str, float | None]] = []
        self._begin()

    def _begin(self) -> None:
        self._began, self._nap_s = time.monotonic(), 0.0
        self._stolen, self._waited = _stolen_s(), _waited_s()

    def woke(self, late_s: float) -> None:
        """Records a sleep with this delay."""
        self._nap_s = max(self._nap_s, late_s)
        if time.monotonic() - self._began >= LOOK_S:
            self.end()

    def end(self) -> None:
        """Ends the current measurement."""
        waited = _waited_s()
        self.reported.append(
            {
                "began_s": self._began,
                "ended_s": time.monotonic(),
                "nap_ms": 1e3 * self._nap_s,
                "stolen_s": _stolen_s() - self._stolen,
                "waited_s": None
                if waited is None or self._waited is None
                else waited - self._waited,
            }
        )
        self._begin()


def watch() -> None:
    """Runs until the input closes."""
    looks = Looks()
    while True:
        slept = time.monotonic()
        asked, _, _ = select.select([0], [], [], SLEEP_S)
        if not asked:
            looks.woke(time.monotonic() - slept - SLEEP_S)
            continue
        # The requesting process may have been delayed as well: a finished sleep also counts.
        looks.woke(max(0.0, time.monotonic() - slept - SLEEP_S))
        if not os.read(0, 4096):
            return
        looks.end()
        sys.stdout.write(json.dumps(looks.reported) + "\n")
        sys.stdout.flush()
        looks.reported = []


if __name__ == "__main__":
    watch()
