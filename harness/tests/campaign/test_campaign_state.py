# SPDX-License-Identifier: Apache-2.0
"""Progress of a campaign, read from its ledger; growing files are read incrementally."""

import json
import os
import subprocess
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from slambed.campaign.campaign_state import (
    CampaignState,
    being_run,
    is_alive,
    state_of_ledger,
)
from slambed.campaign.growing_file import GrowingFile
from slambed.campaign.ledger import Ledger
from slambed.serve.experiments import status_of

KEYS = ["a", "b", "c", "d"]
PID = 4711


def at(second: float) -> str:
    return datetime.fromtimestamp(1_000_000 + second, UTC).isoformat(timespec="milliseconds")


def line(second: float, event: str, key: str | None = None, **more: Any) -> dict[str, Any]:
    run = {} if key is None else {"run_key": key, "cell": f"cell-{key}", "repetition": 0}
    return {"time_utc": at(second), "event": event, "pid": PID, **run, **more}


def started(second: float = 0.0, todo: list[str] = KEYS) -> dict[str, Any]:
    return line(second, "campaign_started", todo=todo, runs=len(KEYS) + 2)


def state(*entries: dict[str, Any], now: float = 100.0, alive: bool = True) -> CampaignState:
    found = state_of_ledger("x", entries, 1_000_000 + now, lambda pid, since_s: alive)
    assert found is not None
    return found


def test_an_empty_ledger_reports_no_campaign() -> None:
    assert state_of_ledger("x", [], 0.0) is None
    assert state_of_ledger("x", [line(1, "run_started", "a")], 0.0) is None


def test_runs_that_were_not_asked_for_were_not_there() -> None:
    assert state(line(0, "campaign_started", todo=KEYS, runs=60, there=5)).there_before == 5


def test_runs_are_waiting_in_hand_and_done() -> None:
    found = state(
        started(),
        line(1, "run_started", "a"),
        line(11, "run_finished", "a", valid=True),
        line(11, "run_started", "b"),
        line(31, "run_finished", "b", valid=False),
        line(31, "run_started", "c"),
        now=36,
    )
    assert (found.asked, found.there_before) == (4, 2)
    assert (found.valid, found.invalid, found.failed, found.done) == (1, 1, 0, 2)
    assert [(run.run_key, run.name) for run in found.in_hand] == [("c", "cell-c #1")]
    assert found.waiting == 1
    # Mean duration 15 s: 10 s left for c, and all of d.
    assert found.left_s == pytest.approx(25)
    assert status_of(found) == "running: 2 of 4 runs, about 25 s left"


def test_time_left_is_shared_by_runs_side_by_side() -> None:
    found = state(
        started(),
        line(0, "run_started", "a"),
        line(0, "run_started", "b"),
        line(10, "run_finished", "a", valid=True),
        line(10, "run_finished", "b", valid=True),
        now=10,
    )
    assert found.left_s == pytest.approx(10)
    assert state(started(), line(0, "run_started", "a")).left_s is None


def test_a_run_that_is_tried_again_is_in_hand_again() -> None:
    failed = [line(1, "run_started", "a"), line(2, "run_failed", "a", error="gone")]
    assert (state(started(), *failed).failed, state(started(), *failed).waiting) == (1, 3)
    again = state(started(), *failed, line(3, "run_started", "a"))
    assert (again.failed, len(again.in_hand)) == (0, 1)


def test_only_the_last_campaign_counts_and_only_its_runs() -> None:
    found = state(
        started(0),
        line(1, "run_started", "a"),
        line(2, "run_finished", "a", valid=True),
        line(3, "campaign_ended", interrupted=False),
        started(10, ["b"]),
        line(11, "run_started", "zzz"),
        line(12, "run_started", "b"),
    )
    assert (found.asked, found.done) == (1, 0)
    assert [run.run_key for run in found.in_hand] == ["b"]


@pytest.mark.parametrize(
    ("alive", "end", "words"),
    [
        (True, None, "running: 0 of 4 runs"),
        (False, None, "broken off: its process is gone"),
        (True, False, "ended"),
        (False, True, "interrupted"),
    ],
)
def test_a_campaign_runs_has_ended_or_was_killed(alive: bool, end: bool | None, words: str) -> None:
    tail = [] if end is None else [line(5, "campaign_ended", interrupted=end)]
    found = state(started(), line(1, "run_started", "a"), *tail, alive=alive)
    assert status_of(found) == words
    assert bool(found.in_hand) == found.alive == (alive and end is None)


def test_a_process_that_got_the_number_later_is_another_one() -> None:
    now = datetime.now(UTC).timestamp()
    assert is_alive(os.getpid(), now)
    assert not is_alive(os.getpid(), now - 1e6)
    assert not is_alive(2**22 + 1, now)


def test_a_process_that_its_parent_has_not_asked_for_is_dead() -> None:
    """A killed campaign may be a zombie if its parent does not wait for it."""
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        since_s = time.time()
        assert is_alive(process.pid, since_s)
        process.kill()
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        assert not is_alive(process.pid, since_s)


def test_a_real_ledger_is_read(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path / "ledger.jsonl")
    ledger.append("campaign_started", runs=1, todo=["a"])
    ledger.append("run_started", run_key="a", cell="x", repetition=2)
    found = state_of_ledger("x", ledger.read(), datetime.now(UTC).timestamp())
    assert found is not None and found.alive and found.pid == os.getpid()
    assert [run.name for run in found.in_hand] == ["x #3"]


def test_a_dry_run_is_reported_who_runs_the_experiment(tmp_path: Path) -> None:
    assert being_run(tmp_path, "x") == []
    (tmp_path / "x").mkdir()
    ledger = Ledger(tmp_path / "x" / "ledger.jsonl")
    ledger.append("campaign_started", runs=2, todo=["a", "b"])
    assert being_run(tmp_path, "x") == [f"being run by process {os.getpid()}: 0 of 2 runs so far"]
    ledger.append("campaign_ended", interrupted=False)
    assert being_run(tmp_path, "x") == []


def test_a_growing_file_gives_each_line_once_and_whole(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    file = GrowingFile(path)
    assert file.new() == []
    path.write_text('{"a": 1}\n{"a": 2}\n{"a"')
    assert [e["a"] for e in file.new()] == [1, 2]
    assert file.new() == []
    with path.open("a") as out:
        out.write(': 3}\nno json\n{"a": 4}\n')
    assert [e["a"] for e in file.new()] == [3, 4]


def test_a_file_in_its_place_is_read_from_its_beginning(tmp_path: Path) -> None:
    path, new = tmp_path / "events.jsonl", tmp_path / "new"
    path.write_text(json.dumps({"a": 1}) + "\n")
    file = GrowingFile(path)
    assert len(file.new()) == 1
    new.write_text(json.dumps({"a": 5}) + "\n" + json.dumps({"a": 6}) + "\n")
    new.rename(path)
    assert [e["a"] for e in file.new()] == [5, 6]
