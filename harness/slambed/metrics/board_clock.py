# SPDX-License-Identifier: Apache-2.0
"""Converts the records of a mobile node on a board to the clock of its edge.

The board's run time 0 came from a clock comparison, so its run clock started exact. The drift
during the run follows from the comparison after the run.
"""

from collections.abc import Iterable

from slambed.link.clocks import Clocks
from slambed.metrics.events import Event, EventLog

NS_PER_MS = 1e6
MOBILE_SENT = ("queued_ns", "sent_ns")
"""Fields of an uplink message, logged by the edge; of a downlink message the board logs
`received_ns`."""
UP_MS = ("t_me_ms", "t_up_ms", "up_ms", "transport_ms", "upload_ms")
"""Durations from a board time to an edge time: too short by the gain of the board's clock."""
DOWN_MS = ("t_em_ms", "t_down_ms", "down_ms", "download_ms")
"""Durations from an edge time to a board time: too long by the same gain."""


def on_one_clock(log: EventLog, clocks: Clocks) -> EventLog:
    """Returns the same events with the board's times converted to the edge's clock."""
    events = sorted(_corrected(log.events, clocks), key=lambda event: event["t_ns"])
    return EventLog(events, log.problems)


def _corrected(events: Iterable[Event], clocks: Clocks) -> Iterable[Event]:
    for event in events:
        mobile = event["node"] == "mobile"
        changed = dict(event)
        gained_ns = clocks.gained_ns(clocks.t0_ns + event["t_ns"])
        stamps = ["t_ns", "received_ns"] if mobile else []
        if event["type"] == "message" and not mobile:
            stamps += MOBILE_SENT
        elif mobile and event.get("dropped"):
            stamps += MOBILE_SENT  # logged by its sender
        for key in stamps:
            if isinstance(event.get(key), int):
                changed[key] = event[key] - gained_ns
        for keys, sign in ((UP_MS, 1), (DOWN_MS, -1)) if mobile else ():
            for key in keys:
                if isinstance(event.get(key), int | float):
                    changed[key] = event[key] + sign * gained_ns / NS_PER_MS
        yield changed
