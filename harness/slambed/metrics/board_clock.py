# SPDX-License-Identifier: Apache-2.0
"""Brings what a mobile node on a board wrote to the clock of its edge.

The board was given run time 0 by a comparison of both clocks, so its run clock began right; while
the run lasted it gained or lost, and by how much the comparison afterwards says.
"""

from collections.abc import Iterable

from slambed.link.clocks import Clocks
from slambed.metrics.events import Event, EventLog

NS_PER_MS = 1e6
MOBILE_SENT = ("queued_ns", "sent_ns")
"""Of a message that went up, reported by the edge; what came down was `received_ns` by the
board."""
UP_MS = ("t_me_ms", "t_up_ms", "up_ms", "transport_ms", "upload_ms")
"""From a moment of the board to one of the edge: too short by what the board's clock gained."""
DOWN_MS = ("t_em_ms", "t_down_ms", "down_ms", "download_ms")
"""The other way: too long by it."""


def on_one_clock(log: EventLog, clocks: Clocks) -> EventLog:
    """The same events with the board's times as the edge's clock had them."""
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
            stamps += MOBILE_SENT  # by its sender
        for key in stamps:
            if isinstance(event.get(key), int):
                changed[key] = event[key] - gained_ns
        for keys, sign in ((UP_MS, 1), (DOWN_MS, -1)) if mobile else ():
            for key in keys:
                if isinstance(event.get(key), int | float):
                    changed[key] = event[key] + sign * gained_ns / NS_PER_MS
        yield changed
