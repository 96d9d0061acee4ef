# SPDX-License-Identifier: Apache-2.0
"""Clock offset between two machines, with a strict error bound.

Exchanges follow NTP (RFC 5905, sec. 8): t1 sent here, t2 received there, t3 sent there, t4 received
here. Both delays are positive, so t3 - t4 <= offset <= t2 - t1, however asymmetric they are. Over
many exchanges the interval shrinks to the delay of the fastest ones.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from slambed.errors import PassingError
from slambed.files.json_file import Record

MOST_RATE = 5e-4
"""Maximum relative rate of two clocks: the maximum slew of NTP (RFC 5905, sec. 11.3: 500 ppm)."""
EXCHANGES = 40
NS_PER_MS = 1e6


@dataclass(frozen=True)
class Exchange:
    """One request and its reply, in CLOCK_MONOTONIC of each machine [ns]."""

    sent_ns: int
    """Clock of this machine."""
    received_ns: int
    """Clock of the other machine."""
    answered_ns: int
    """Clock of the other machine."""
    back_ns: int
    """Clock of this machine."""

    @property
    def traveled_ns(self) -> int:
        """Sum of both one-way delays."""
        return (self.back_ns - self.sent_ns) - (self.answered_ns - self.received_ns)


class ClockComparison(Record):
    """Result of one series of exchanges."""

    at_ns: int
    """Middle of the series, CLOCK_MONOTONIC of this machine."""
    offset_ns: int
    """CLOCK_MONOTONIC of the board minus that of this machine."""
    error_ns: int
    """Bound of the error of the offset, for any asymmetry of the delays."""
    exchanges: int
    """Number of exchanges with a reply."""
    traveled_us_min: float
    """Sum of both one-way delays in the fastest exchange."""
    over: str
    """`udp`, or `ssh` if no datagram got through."""


class Clocks(Record):
    """The board's clock relative to this machine's, before and after a run."""

    t0_ns: int
    """Run time 0, CLOCK_MONOTONIC of this machine."""
    before: ClockComparison
    """Comparison that run time 0 on the board was derived from."""
    after: ClockComparison | None = None
    """Null if the run ended too early."""

    @property
    def rate(self) -> float:
        """Seconds that the board's clock gains per second of this machine's clock."""
        if self.after is None or self.after.at_ns <= self.before.at_ns:
            return 0.0
        gained_ns = self.after.offset_ns - self.before.offset_ns
        return gained_ns / (self.after.at_ns - self.before.at_ns)

    @property
    def drift_ppm(self) -> float:
        """`rate` in ppm."""
        return self.rate * 1e6

    @property
    def error_ms(self) -> float:
        """Bound of the error of a board timestamp converted by `here_ns`."""
        both = (self.before, self.after or self.before)
        return max(each.error_ns for each in both) / NS_PER_MS

    def here_ns(self, board_ns: int) -> int:
        """Converts a board time to CLOCK_MONOTONIC of this machine. The offset is known before
        and after the run and interpolated linearly."""
        guess_ns = board_ns - self.before.offset_ns
        since_ns = guess_ns - self.before.at_ns
        return guess_ns - round(since_ns * self.rate / (1.0 + self.rate))

    def gained_ns(self, here_ns: int) -> int:
        """Returns how far the board's run clock, which started exact, is ahead at a time of this
        machine."""
        return round((here_ns - self.before.at_ns) * self.rate)


def compare(exchanges: Iterable[Exchange], over: str) -> ClockComparison:
    """Returns the offset that is consistent with all exchanges. Raises PassingError if there is
    none."""
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
    """Calls `ask` EXCHANGES times; it returns None for a lost exchange."""
    return compare((e for e in (ask() for _ in range(EXCHANGES)) if e is not None), over)
