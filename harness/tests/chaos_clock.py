# SPDX-License-Identifier: Apache-2.0
"""Jumps of the host's time of day, taken back by the clock that nobody can set."""

import time


class Clock:
    """CLOCK_REALTIME, and where it was beside CLOCK_MONOTONIC when this was made."""

    def __init__(self) -> None:
        self._offset_ns = self._now_ns()

    @staticmethod
    def _now_ns() -> int:
        return time.clock_gettime_ns(time.CLOCK_REALTIME) - time.monotonic_ns()

    def jump(self, seconds: float) -> bool:
        """Sets it so far beside the right time; False where that is not allowed."""
        there_ns = self._offset_ns + round(seconds * 1e9)
        try:
            time.clock_settime_ns(time.CLOCK_REALTIME, time.monotonic_ns() + there_ns)
        except PermissionError:
            return False
        return True

    def restore(self) -> None:
        """To the right time."""
        self.jump(0.0)

    def error_ms(self) -> float:
        """How far it is beside the right time."""
        return (self._now_ns() - self._offset_ns) / 1e6
