# SPDX-License-Identifier: Apache-2.0
"""Messages of a run as a table, and the ones that a full queue dropped."""

from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from command_line import refused, slambed
from results_factory import losing

from slambed.errors import ExitCode, SlambedError
from slambed.explain.messages import dropped_lines, write_messages
from slambed.explain.run_log import RunLog
from slambed.metrics.messages import messages_of

MS = 1_000_000


def message(sequence: int, queued_ms: float, **more: Any) -> dict[str, Any]:
    sent = {"sent_ns": queued_ms * MS + 2 * MS, "received_ns": queued_ms * MS + 12.5 * MS}
    return {
        "t_s": queued_ms / 1e3, "type": "message", "node": "edge", "channel": "keyframe",
        "direction": "up", "message": "KEYFRAME", "bytes": 1000 + sequence, "sequence": sequence,
        "queued_ns": queued_ms * MS, **sent, **more,
    }  # fmt: skip


def log_of(*events: dict[str, Any]) -> RunLog:
    return RunLog(Path("run"), "", pd.DataFrame([{"t_s": 9.0, "type": "other"}, *events]), None)


NOT_SENT = {"sent_ns": None, "received_ns": None, "dropped": True}


def test_a_row_per_message_in_the_order_of_sending() -> None:
    run = log_of(message(2, 500), message(1, 100), message(3, 600, node="mobile", **NOT_SENT))
    table = messages_of(run.of("message"))
    assert list(table["sequence"]) == [1, 2, 3]
    first, last = table.iloc[0], table.iloc[2]
    assert (first["queued_s"], first["sent_s"], first["received_s"]) == (0.1, 0.102, 0.1125)
    assert (first["waited_ms"], first["under_way_ms"]) == (2, 10.5)
    assert first["bytes"] == 1001 and not first["dropped"]
    assert last["dropped"] and pd.isna(last["sent_s"]) and pd.isna(last["under_way_ms"])


def test_what_is_no_number_is_left_empty() -> None:
    """As another program may write it."""
    run = log_of(
        message(1, 100),
        {**message(2, 200), "sequence": "two", "bytes": "many", "received_ns": "soon"},
    )
    row = messages_of(run.of("message")).iloc[1]
    assert row[["sequence", "bytes", "received_s", "under_way_ms"]].isna().all()
    assert row["sent_s"] == pytest.approx(0.202)


def test_dropped_messages_are_told_with_the_queue_that_was_full() -> None:
    run = log_of(
        message(1, 100),
        message(2, 200, node="mobile", **NOT_SENT),
        message(3, 300, node="mobile", **NOT_SENT),
        message(4, 400, dropped=True),
    )
    assert dropped_lines(run) == [
        "1 of 4 messages of channel keyframe (up) dropped: the receive queue of the edge node "
        "was full",
        "2 of 4 messages of channel keyframe (up) dropped: the send queue of the mobile node "
        "was full",
    ]
    assert dropped_lines(log_of(message(1, 100))) == []


def test_the_command_writes_them(tmp_path: Path) -> None:
    experiment = losing(tmp_path)
    results, table = str(experiment.parent), tmp_path / "messages.csv"
    of_run = ("0000000000000001", "--results", results)
    code, out, err = slambed("explain", *of_run, "--messages", str(table))
    assert code == 0, err
    rows = pd.read_csv(table)
    assert out == f"{len(rows)} messages, 0 of them dropped: {table}\n" and len(rows)
    assert (rows["received_s"] >= rows["sent_s"]).all()
    line = refused(ExitCode.BAD_INPUT, "explain", *of_run, "--messages", "messages.txt")
    assert "unknown table format messages.txt; known: .csv" in line
    line = refused(
        ExitCode.BAD_INPUT, "explain", *of_run, "--messages", "m.csv", "--around", "loss"
    )
    assert "--messages draws nothing; give it alone" in line


def test_a_run_without_messages_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match="no messages in run"):
        write_messages(log_of(), tmp_path / "messages.csv")
    assert not (tmp_path / "messages.csv").exists()
