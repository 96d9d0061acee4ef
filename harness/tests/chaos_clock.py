# SPDX-License-Identifier: Apache-2.0
"""Jumps of the host's time of day, reverted with the monotonic clock."""

import time


class Clock:
    """CLOCK_REALTIME, and its initial offset to CLOCK_MONOTONIC."""

    def __init__(self) -> None:
        self._offset_ns = self._now_ns()

    @staticmethod
    def _now_ns() -> int:
        return time.clock_gettime_ns(time.CLOCK_REALTIME) - time.monotonic_ns()

    def jump(self, seconds: float) -> bool:
        """Sets it off by this time; False without permission."""
        there_ns = self._offset_ns + round(seconds * 1e9)
        try:
            time.clock_settime_ns(time.CLOCK_REALTIME, time.monotonic_ns() + there_ns)
        except PermissionError:
            return False
        return True

    def restore(self) -> None:
        """Restores the correct time."""
        self.jump(0.0)

    def error_ms(self) -> float:
        """Returns the deviation from the correct time."""
        return (self._now_ns() - self._offset_ns) / 1e6
