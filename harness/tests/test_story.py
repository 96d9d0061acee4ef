# SPDX-License-Identifier: Apache-2.0
"""The lines that tell a run: what a run need not be made for."""

from pathlib import Path
from typing import Any

import pandas as pd

from slambed.explain.run_log import RunLog
from slambed.explain.story import MOST_CHANGES, story


def log_of(*events: dict[str, Any]) -> RunLog:
    tracked = {"t_s": 60.0, "type": "frame_tracked", "state": "ok", "reason": None}
    return RunLog(Path(), "", pd.DataFrame([*events, tracked]), None)


def change(t_s: float, before: str, after: str, rtt_ms: float | None) -> dict[str, Any]:
    told = {} if rtt_ms is None else {"rtt_ms": rtt_ms}
    return {"t_s": t_s, "type": "state_changed", "from": before, "to": after, **told}


def test_every_change_of_state_is_a_line() -> None:
    lines = story(
        log_of(
            change(0.5, "start", "SZ", None),
            change(2.345, "SZ", "OS", 11.7),
            change(9.0, "OS", "MES", 97.2),
        )
    )
    assert [line for line in lines if "state" in line] == [
        "state SZ at 0.50 s: no RTT known",
        "state SZ to OS at 2.35 s: RTT 12 ms",
        "state OS to MES at 9.00 s: RTT 97 ms",
    ]


def test_many_changes_of_state_are_counted() -> None:
    ways = [("start", "OS"), *[("OS", "SZ"), ("SZ", "OS")] * 7]
    changes = [change(float(i), *way, 50.0 + i) for i, way in enumerate(ways)]
    assert [line for line in story(log_of(*changes)) if "state" in line] == [
        "state OS at 0.00 s: RTT 50 ms",
        "state OS to SZ at 1.00 s: RTT 51 ms",
        "... 12 more state changes; of all: OS to SZ 7, SZ to OS 7",
        "state SZ to OS at 14.00 s: RTT 64 ms",
    ]
    few = [line for line in story(log_of(*changes[:MOST_CHANGES])) if "state" in line]
    assert len(few) == MOST_CHANGES and not any("more" in line for line in few)


def test_a_system_without_states_has_no_line_of_them() -> None:
    assert not any("state" in line for line in story(log_of()))
