# SPDX-License-Identifier: Apache-2.0
"""Lines of the story that can be tested without a real run."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from slambed.explain.run_log import RunLog, RunStatus
from slambed.explain.story import MOST_CHANGES, story
from slambed.metrics.event_columns import EVENT_COLUMNS, frame_of


def log_of(*events: dict[str, Any]) -> RunLog:
    tracked = {"t_s": 60.0, "type": "frame_tracked", "state": "ok"}
    table = frame_of([*events, tracked], EVENT_COLUMNS | {"t_s": pa.float64()})
    return RunLog(Path(), "", table, None)


def change(t_s: float, before: str, after: str, rtt_ms: float | None) -> dict[str, Any]:
    reported = {} if rtt_ms is None else {"rtt_ms": rtt_ms}
    return {"t_s": t_s, "type": "state_changed", "from": before, "to": after, **reported}


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


def test_made_keyframes_are_not_taken_for_those_left_in_the_map() -> None:
    made = {"t_ns": 10**9, "type": "keyframe_created", "node": "mobile", "keyframe": 1}
    assert story(log_of(made))[0].endswith("; 1 keyframe created")


def test_a_system_without_states_has_no_line_of_them() -> None:
    assert not any("state" in line for line in story(log_of()))


def test_how_a_run_ended_and_why_it_is_invalid_is_reported() -> None:
    fine = log_of()
    assert not any("valid" in line or "system" in line for line in story(fine))
    ended = RunStatus("timed_out", "no frame for 30 s", False, "RTT error 9 ms", 3, 4.2)
    lines = story(replace(fine, status=ended))
    assert lines[1:5] == [
        "the system timed out: no frame for 30 s",
        "invalid: RTT error 9 ms",
        "attempt 3, the earlier ones were invalid or were run again on request",
        "steal: neighbors took 4.2 % of this host's CPU time",
    ]


def stalled_run(steal_s: float, **status: Any) -> RunLog:
    """Returns twenty extractions, one of which stalled for 150 ms at 10 s, and one loss at 10.5
    s."""
    events = [
        {
            "t_s": float(i),
            "t_ns": i * 10**9,
            "type": "stage",
            "node": "mobile",
            "name": "extract",
            "worker": "tracking",
            "wall_ms": 170.0 if i == 10 else 20.0,
            "cpu_ms": 18.0,
        }
        for i in range(1, 21)
    ]
    loss = {"t_s": 10.5, "type": "track_lost", "node": "mobile", "inliers": None}
    times = np.arange(0.0, 20.0, 0.1)
    samples = pd.DataFrame({"t_s": times, "host_steal_s": steal_s * (times > 10)})
    return replace(log_of(*events, loss), samples=samples, status=RunStatus(**status))


def test_a_stall_is_reported_with_the_steal_beside_it() -> None:
    lines = story(stalled_run(0.5))
    message = "the host stalled the mobile node for 150 ms at 10.00 s"
    assert f"{message}, while neighbors had 25 % of a processor (steal)" in lines
    (loss,) = [line for line in lines if line.startswith("track lost")]
    assert "neighbors had 25 % of a processor (steal)" in loss
    quiet = story(stalled_run(0.0))
    assert message in quiet and not any("steal" in line for line in quiet)
    assert not any("stalled" in line for line in story(stalled_run(0.0, virtual=True)))


@pytest.mark.parametrize(
    ("missing", "line"),
    [
        ([2], "1 map update applied, T_MU 40 ms, 2 newer keyframes missing from it"),
        ([0, 1], "2 map updates applied, T_MU 40 ms, 1 newer keyframe missing from them"),
    ],
)
def test_keyframes_that_an_update_lacks_are_not_lost_by_the_link(
    missing: list[int], line: str
) -> None:
    events = [
        {"t_s": 1.0 + i, "type": "update_applied", "node": "mobile", "t_mu_ms": 40.0}
        | {"update": i + 1, "gap_keyframes": count}
        for i, count in enumerate(missing)
    ]
    assert line in story(log_of(*events))
    events[0]["relocalization"] = True
    count, rest = line.split(" applied, ")
    among = f"({'' if len(missing) == 1 else '1 of them '}for a relocalization)"
    assert f"{count} applied {among}, {rest}" in story(log_of(*events))


def test_an_update_without_its_time_has_none_in_its_line() -> None:
    update = {"t_s": 1.0, "type": "update_applied", "node": "mobile", "update": 1}
    assert "1 map update applied" in story(log_of(update))


def test_a_stall_of_the_link_is_reported_with_its_end() -> None:
    def link(t_s: float, node: str, channel: str, event: str) -> dict[str, Any]:
        detail = "nothing acknowledged for 1000 ms" if event == "stalled" else "after 4000 ms"
        of = {"node": node, "channel": channel, "detail": detail}
        return {"t_s": t_s, "type": "link", "event": event, **of}

    lines = story(
        log_of(
            link(1.0, "mobile", "keyframe", "connected"),
            link(12.0, "mobile", "keyframe", "stalled"),
            link(13.0, "edge", "keyframe", "flowing"),
            link(15.0, "mobile", "keyframe", "flowing"),
            link(20.0, "edge", "map", "stalled"),
        )
    )
    reported = [line for line in lines if "stalled" in line]
    assert reported == [
        "keyframe stalled at the mobile node: nothing acknowledged for 1000 ms at 12.00 s, "
        "until 15.00 s",
        "map stalled at the edge node: nothing acknowledged for 1000 ms at 20.00 s, to the end",
    ]
