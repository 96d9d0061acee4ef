# SPDX-License-Identifier: Apache-2.0
"""The parts of a map update round: from the events through the summary to the table."""

import json
from pathlib import Path
from typing import Any

import pytest
from results_factory import RawRun, quickstart_like, spec_of, write_experiment, write_raw

from slambed.metrics.events import EventLog
from slambed.metrics.run_summary import summarize_with_problems
from slambed.metrics.stages import delays
from slambed.metrics.update_round import (
    CLOSURE_LIMIT_MS,
    PART_FIELDS,
    UpdateRound,
    update_rounds,
)
from slambed.report.experiment import write_report
from slambed.report.load import load
from slambed.report.rounds import update_round_tables


def applied(t_ns: int = 9, **changes: Any) -> dict[str, Any]:
    values = (60.0, 5.0, 20.0, 110.0, 400.0, 30.0, 7.0, 90.0)
    parts = dict(zip(PART_FIELDS.values(), values, strict=True))
    return {
        "t_ns": t_ns,
        "type": "update_applied",
        "node": "mobile",
        "update": 1,
        "newest_keyframe": 4,
        "relocalization": False,
        "gap_keyframes": 3,
        **parts,
        "t_total_ms": sum(parts.values()),
    } | changes


def test_parts_are_reported_by_the_event_and_add_up() -> None:
    (round_,) = update_rounds(EventLog([applied()]))
    assert round_.parts_ms["T_LM"] == 110.0
    assert round_.total_ms == 722.0
    assert round_.computed_ms == 322.0
    assert round_.closure_error_ms == 0.0
    assert round_.gap_keyframes == 3


def test_relocalization_maps_and_events_without_parts_are_left_out() -> None:
    log = EventLog([applied(relocalization=True), applied(t_plmu_ms=None)])
    assert update_rounds(log) == []


def test_delays_take_the_reported_parts_before_what_comes_near() -> None:
    log = EventLog([applied(1), applied(2, t_lm_ms=130.0, t_total_ms=742.0)])
    found = delays(log)
    assert found["T_LM"].mean_ms == 120.0
    assert found["T_LM"].std_ms == 10.0
    assert found["T_Total"].mean_ms == 732.0
    assert found["T_Computed"].count == 2


@pytest.mark.parametrize("error_ms", [0.0, 1.5, 3.0])
def test_summary_reports_gap_messages_and_how_far_the_parts_are_off(
    tmp_path: Path, error_ms: float
) -> None:
    raw = write_raw(tmp_path / "raw", RawRun())
    events = raw / "mobile" / "events.jsonl"
    with events.open("w") as out:
        for event in (
            applied(t_total_ms=722.0 + error_ms),
            applied(gap_keyframes=0),
            {"type": "stage", "name": "serialize_text", "wall_ms": 12.0, "node": "mobile"},
            {"type": "message", "message": "MAP_UPDATE", "bytes": 300_000},
        ):
            out.write(json.dumps({"t_ns": 10**9} | event) + "\n")
    with (raw / "edge" / "events.jsonl").open("w") as out:
        for size in (40_000, 44_000, 50_000):
            event = {"t_ns": 10**9, "type": "message", "message": "KEYFRAME", "bytes": size}
            out.write(json.dumps(event) + "\n")
    summary, problems = summarize_with_problems(raw, {"device_edge": {"name": "host"}})
    assert summary["update_gap_keyframes_mean"] == 1.5
    assert summary["update_parts_error_ms_max"] == pytest.approx(error_ms)
    assert summary["update_bytes_median"] == 300_000
    assert summary["keyframe_bytes_median"] == 44_000
    assert summary["serialize_ms_median"] == 12.0
    assert any("do not add up" in line for line in problems) == (error_ms > CLOSURE_LIMIT_MS)


def test_one_update_has_no_spread(tmp_path: Path) -> None:
    run = RawRun(duration_s=1.5)  # three keyframes, one update
    (table,) = update_round_tables(
        load(write_experiment(tmp_path, [(spec_of("edgeslam", "static", "none", 0), run)]))
    )
    row = dict(zip(table.headings, table.rows[0], strict=True))
    assert row["updates"] == "1"
    assert row["T_MU"] == "30.0 ± -"


def test_report_has_one_row_per_cell_that_reports_its_rounds(tmp_path: Path) -> None:
    experiment = quickstart_like(tmp_path, repetitions=2)
    (table,) = update_round_tables(load(experiment))
    assert [row[0] for row in table.rows] == ["edgeslam:static"] * 2  # only those with an edge
    row = dict(zip(table.headings, table.rows[0], strict=True))
    assert row["T_MU"] == "30.0 ± 0.0"
    assert int(row["updates"]) > 1
    assert table.caption.startswith("Parts of a map update round")
    assert "T_Total" in (write_report(experiment, figures=False).markdown).read_text()


def test_parts_are_added_alike_by_every_python() -> None:
    """One after the other, ten times 0.1 is not 1; sum() did that before Python 3.12."""
    tenths = dict(zip("abcdefghij", [0.1] * 10, strict=True))
    assert UpdateRound(tenths, 1.0, None).closure_error_ms == 0
