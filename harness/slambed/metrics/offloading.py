# SPDX-License-Identifier: Apache-2.0
"""Where mapping ran: states of a system that moves it between the nodes, and its changes."""

from collections.abc import Mapping
from typing import Any

from slambed.metrics.events import EventLog

STATES = {"OS": "state_os_s", "SZ": "state_sz_s", "MES": "state_mes_s"}
"""DynNetSLAM's states and the summary key of the time spent in each."""
BEGIN = "start"
"""`from` of the first decision: it chooses a state, it is no switch."""


def offloading_summary(log: EventLog, end_s: float | None) -> Mapping[str, Any]:
    """Switches, and seconds of playback in each state; nothing for a system without states."""
    changes = log.of("state_changed")
    if not changes or end_s is None:
        return {}
    seconds = dict.fromkeys(STATES.values(), 0.0)
    times = [change["t_ns"] / 1e9 for change in changes]
    for change, begin_s, stop_s in zip(changes, times, [*times[1:], end_s], strict=True):
        key = STATES.get(str(change.get("to")))
        if key is not None:
            seconds[key] += max(0.0, min(stop_s, end_s) - begin_s)
    switches = sum(change.get("from") != BEGIN for change in changes)
    declined = log.of("update_declined")
    return {
        **seconds,
        "state_switches": switches,
        "updates_stale": sum(event.get("reason") == "older epoch" for event in declined),
    }
