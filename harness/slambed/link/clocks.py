# SPDX-License-Identifier: Apache-2.0
"""How far the clocks of two machines are apart, with a bound of the error that always holds.

An exchange is NTP's (RFC 5905, sec. 8): t1 sent here, t2 received there, t3 sent there, t4 received
here. Both ways take longer than nothing, so t3 - t4 <= offset <= t2 - t1, however much longer one
way takes than the other; over many exchanges what is left is as wide as the quickest were slow.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from slambed.errors import PassingError
from slambed.files.json_file import Record

MOST_RATE = 5e-4
"""By which two clocks may run apart: the most that NTP slews one (RFC 5905, sec. 11.3: 500 ppm)."""
EXCHANGES = 40
NS_PER_MS = 1e6


@dataclass(frozen=True)
class Exchange:
    """One question and its answer, CLOCK_MONOTONIC of either machine [ns]."""

    sent_ns: int
    """Here."""
    received_ns: int
    """There."""
    answered_ns: int
    """There."""
    back_ns: int
    """Here."""

    @property
    def traveled_ns(self) -> int:
        """Both ways together."""
        return (self.back_ns - self.sent_ns) - (self.answered_ns - self.received_ns)


class ClockComparison(Record):
    """What one series of exchanges said."""

    at_ns: int
    """Its middle, CLOCK_MONOTONIC of this machine."""
    offset_ns: int
    """CLOCK_MONOTONIC of the board minus that of this machine."""
    error_ns: int
    """The true offset is within this of it, however unequal both ways were."""
    exchanges: int
    """That came back."""
    traveled_us_min: float
    """Both ways of the quickest one."""
    over: str
    """`udp`, or `ssh` where no datagram came through."""


class Clocks(Record):
    """The board's clock against this machine's: before and after a run."""

    t0_ns: int
    """Run time 0, CLOCK_MONOTONIC of this machine."""
    before: ClockComparison
    """The board was given run time 0 by it."""
    after: ClockComparison | None = None
    """Null: the run did not get so far."""

    @property
    def rate(self) -> float:
        """Seconds that the board's clock gains in one of this machine's."""
        if self.after is None or self.after.at_ns <= self.before.at_ns:
            return 0.0
        gained_ns = self.after.offset_ns - self.before.offset_ns
        return gained_ns / (self.after.at_ns - self.before.at_ns)

    @property
    def drift_ppm(self) -> float:
        """The same in millionths."""
        return self.rate * 1e6

    @property
    def error_ms(self) -> float:
        """Bound of the error of a time stamp of the board after `here_ns`."""
        both = (self.before, self.after or self.before)
        return max(each.error_ns for each in both) / NS_PER_MS

    def here_ns(self, board_ns: int) -> int:
        """CLOCK_MONOTONIC of this machine at a moment of the board's: both ends of the run are
        known, and between them the board's clock is taken to gain evenly."""
        guess_ns = board_ns - self.before.offset_ns
        since_ns = guess_ns - self.before.at_ns
        return guess_ns - round(since_ns * self.rate / (1.0 + self.rate))

    def gained_ns(self, here_ns: int) -> int:
        """How far the board's run clock, which began right, is ahead at a moment of here."""
        return round((here_ns - self.before.at_ns) * self.rate)


def compare(exchanges: Iterable[Exchange], over: str) -> ClockComparison:
    """The offset that all exchanges allow. PassingError where they allow none."""
    found = list(exchanges)
    if not found:
        raise PassingError("the clocks cannot be compared: no exchange came back")
    lowest = max(e.answered_ns - e.back_ns for e in found)
    highest = min(e.received_ns - e.sent_ns for e in found)
    first, last = min(e.sent_ns for e in found), max(e.back_ns for e in found)
    slack_ns = round(MOST_RATE * (last - first))
    if lowest > highest + 2 * slack_ns:
        raise PassingError("the clocks cannot be compared: one of them was set meanwhile")
    return ClockComparison(
        at_ns=(first + last) // 2,
        offset_ns=(lowest + highest) // 2,
        error_ns=max(0, highest - lowest) // 2 + slack_ns,
        exchanges=len(found),
        traveled_us_min=min(e.traveled_ns for e in found) / 1e3,
        over=over,
    )


def compare_by(ask: Callable[[], Exchange | None], over: str) -> ClockComparison:
    """By asking so often; an exchange that was lost is None."""
    return compare((e for e in (ask() for _ in range(EXCHANGES)) if e is not None), over)
