# SPDX-License-Identifier: Apache-2.0
"""A campaign over several experiments: counts, time left, budget, and parts for machines."""

import json
from pathlib import Path

import pytest
from harness_parts import specs
from rich.console import Console
from test_force import Scripted, campaign
from virtual_parts import Quiet

from slambed.campaign.order import in_part, part_of
from slambed.campaign.outlook import mean_run_s
from slambed.campaign.overall import Outlook, Overall, budget_s
from slambed.campaign.progress import CampaignProgress
from slambed.errors import SlambedError


class Clock:
    """A clock that only tests move."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("2h", 7200), ("90min", 5400), ("1h30min", 5400), ("45m", 2700), ("20s", 20), ("1.5h", 5400)],
)
def test_a_budget_is_read(text: str, seconds: float) -> None:
    assert budget_s(text) == seconds


@pytest.mark.parametrize("text", ["", "2", "h", "2 h", "-1h", "0h", "two hours", "1h-5min"])
def test_a_budget_that_is_no_time_is_refused(text: str) -> None:
    with pytest.raises(SlambedError, match="write 2h, 90min or 1h30min"):
        budget_s(text)


def test_every_run_is_in_one_part() -> None:
    keys = [spec.run_key for spec in specs(cells=6, runs=5)]
    parts = [part_of(f"{i}/3") for i in (1, 2, 3)]
    of_each = [[key for key in keys if in_part(key, part)] for part in parts]
    assert sorted(key for own in of_each for key in own) == sorted(keys)
    assert all(of_each)
    assert all(in_part(key, None) for key in keys)


@pytest.mark.parametrize("text", ["3", "0/2", "3/2", "1/0", "a/b", "1/2/3"])
def test_a_part_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(SlambedError, match="is no part"):
        part_of(text)


def test_the_time_left_is_corrected_by_what_runs_took() -> None:
    overall = Overall({"a": Outlook(10, 10, 6.0), "b": Outlook(20, 5, 2.0)}, jobs=2)
    assert (overall.done, overall.total, overall.left) == (15, 30, 15)
    assert overall.left_s() == (10 * 6 + 5 * 2) / 2
    overall.ended("a", 12.0)
    overall.ended("a", 12.0)
    assert (overall.done, overall.left) == (17, 13)
    assert overall.left_s() == 2 * (8 * 6 + 5 * 2) / 2
    overall.given_up("b")
    assert (overall.done, overall.total) == (17, 29)


def test_what_a_campaign_finds_replaces_what_was_expected() -> None:
    overall = Overall({"a": Outlook(10, 10, 6.0)}, jobs=2)
    overall.begin("a", there=7, missing=3, jobs=4)
    assert (overall.done, overall.total, overall.left) == (7, 10, 3)
    assert overall.left_s() == 3 * 6 / 4


def test_a_budget_starts_no_run_after_it_and_ends_none() -> None:
    clock = Clock()
    overall = Overall({"a": Outlook(4, 4, 1.0)}, jobs=1, budget_s=60.0, clock=clock)
    assert not overall.is_used_up
    clock.now_s += 59.9
    assert not overall.is_used_up
    clock.now_s += 0.1
    assert overall.is_used_up
    assert not Overall({}, jobs=1, clock=clock).is_used_up


def test_a_campaign_stops_at_its_budget_and_goes_on_later(tmp_path: Path) -> None:
    todo = specs(cells=2, runs=2)
    left = [2]

    def may_start() -> bool:
        left[0] -= 1
        return left[0] >= 0

    first = campaign(tmp_path, Scripted({}), may_start=may_start)
    outcome = first.run(todo, Quiet())
    assert (outcome.done, outcome.interrupted) == (2, False)
    there = [spec for spec in todo if first.folder.state(spec.run_key) == "valid"]
    assert there == todo[:2]
    rest = [spec for spec in todo if spec not in there]
    assert campaign(tmp_path, Scripted({})).run(rest, Quiet()).done == 2


def test_the_progress_line_is_of_the_whole_campaign() -> None:
    first = specs(cells=1, runs=1)[0]
    overall = Overall({first.experiment: Outlook(3, 3, 60.0), "b": Outlook(7, 6, 60.0)}, jobs=1)
    overall.decided = "1 of 9 orderings decided"
    console = Console(record=True, width=200, force_terminal=False)
    with CampaignProgress(console, 3, 60.0, 1, overall) as progress:
        progress.run_started(first)
        progress.run_ended(first, "completed")
    line = console.export_text().strip()
    assert line.startswith("[ 2/10] ")
    assert line.endswith("left; 1 of 9 orderings decided)")


def test_the_mean_duration_is_of_whole_runs(tmp_path: Path) -> None:
    ledger = tmp_path / "ledger.jsonl"
    lines = []

    def add(second: int, event: str, key: str) -> None:
        time = f"2026-11-25T10:00:{second:02d}.000+00:00"
        lines.append(json.dumps({"time_utc": time, "event": event, "run_key": key}))
        ledger.write_text("\n".join(lines) + "\n")

    assert mean_run_s(ledger) is None
    for number in range(3):
        assert mean_run_s(ledger) is None
        add(10 * number, "run_started", f"k{number}")
        add(10 * number + 4 + number, "run_finished", f"k{number}")
    add(50, "run_started", "interrupted")
    add(59, "run_finished", "without a start")
    assert mean_run_s(ledger) == pytest.approx(5.0)
