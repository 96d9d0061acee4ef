# SPDX-License-Identifier: Apache-2.0
"""Virtual runs give the same bytes for any number of processes, order and cache state."""

from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from rich.console import Console
from virtual_parts import (
    EXPERIMENT,
    Quiet,
    fingerprints,
    make_sequence,
    needs_programs,
    plan_of,
    played_of,
    write_experiment,
)

from slambed.campaign.executors import NoRuns, Played
from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.options import Options
from slambed.campaign.plan import Plan
from slambed.campaign.processes import ProcessExecutor
from slambed.campaign.run_plan import datasets_to_play, run_plan
from slambed.campaign.runner import CampaignOutcome, Runner
from slambed.campaign.store import RunStore
from slambed.data.prepared import SEQUENCE_FILE
from slambed.errors import ExitCode, SlambedError
from slambed.metrics.summary import Summary
from slambed.native import find_program
from slambed.spec.library import Library
from slambed.spec.run_spec import RunSpec

pytestmark = needs_programs


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    folder = tmp_path_factory.mktemp("virtual")
    return plan_of(write_experiment(folder, make_sequence(folder / "walk")))


def make(
    plan: Plan, path: Path, order: list[RunSpec], jobs: int, features: Path | None
) -> ResultFolder:
    folder = ResultFolder(path)
    folder.create()
    pool = ProcessExecutor(played_of(plan), find_program("slambed-sim"), features, jobs)
    verdict = Runner(folder, Ledger(path / "ledger.jsonl"), pool).run(order, Quiet())
    assert (verdict.done, verdict.valid) == (len(order), len(order))
    return folder


def test_processes_order_and_cache_leave_no_trace(plan: Plan, tmp_path: Path) -> None:
    specs, cache = plan.specs, tmp_path / "features"
    one = make(plan, tmp_path / "one", specs, jobs=1, features=cache)
    two = make(plan, tmp_path / "two", specs[::-1], jobs=2, features=cache)
    uncached = make(plan, tmp_path / "uncached", specs[1::2], jobs=1, features=None)

    first = fingerprints(one)
    assert fingerprints(two) == first
    names = {name.split("/", 1)[1] for name in first}
    assert names >= {"events.parquet", "link.parquet", "trajectory.txt", "summary.json"}
    again = fingerprints(uncached)
    assert again == {name: first[name] for name in again} and len(again) > 2 * len(specs)


def test_a_sequence_that_goes_during_a_campaign_makes_no_results(tmp_path: Path) -> None:
    sequence = make_sequence(tmp_path / "walk", 1)
    file = write_experiment(tmp_path, sequence, runs=1)
    plan, (_, source) = plan_of(file), Library().experiment(str(file))
    header, away = sequence / SEQUENCE_FILE, tmp_path / SEQUENCE_FILE

    class Vanishing(ProcessExecutor):
        def execute(self, *given: Any) -> Summary:
            summary = super().execute(*given)
            header.rename(away)
            return summary

    def campaign(kind: type[ProcessExecutor], gone: bool = False) -> CampaignOutcome:
        def executor_of(played: Played) -> ProcessExecutor:
            if gone:
                header.rename(away)
            return kind(played, find_program("slambed-sim"), None, 1)

        try:
            options = Options(results=tmp_path / "results")
            return run_plan(plan, source, options, executor_of, Console())
        finally:
            away.rename(header)

    first = campaign(Vanishing)
    ((lost, why),) = first.given_up.items()
    assert first.valid == 1 and "sequence.json is gone" in why
    # The run that is there shows that runs can be made: no error ends this campaign.
    again = campaign(ProcessExecutor, gone=True)
    assert again.done == 0 and [*again.given_up] == [lost]
    assert RunStore(tmp_path / "results").state(lost) == "missing"


def test_a_campaign_that_fails_has_an_end_too(tmp_path: Path) -> None:
    """`slambed watch` would follow it as long as its process lives."""
    file = write_experiment(tmp_path, make_sequence(tmp_path / "walk", 1), runs=1)
    plan, (_, source) = plan_of(file), Library().experiment(str(file))

    class Broken(NoRuns):
        def execute(self, *given: Any) -> Summary:
            raise SlambedError("no device", ExitCode.ENVIRONMENT)

    options = Options(results=tmp_path / "results")
    with pytest.raises(SlambedError, match="no device"):
        run_plan(plan, source, options, lambda played: Broken(), Console())
    last = Ledger(tmp_path / "results" / "walk" / "ledger.jsonl").read()[-1]
    assert (last["event"], last["done"], last["interrupted"]) == ("campaign_ended", 0, False)


def test_a_board_gets_sequences_of_pending_runs_only(tmp_path: Path) -> None:
    walk = make_sequence(tmp_path / "walk", 1)
    other = make_sequence(tmp_path / "other", 1, name="other")
    text = EXPERIMENT.replace("{sequence}", f"{{sequence}}, {other}")
    plan = plan_of(write_experiment(tmp_path, walk, 1, text))
    results = tmp_path / "results"
    assert datasets_to_play(plan, Options(results=results)) == {"walk", "other"}
    only = Options(results=results, only=["dataset=other"])
    assert datasets_to_play(plan, only) == {"other"}


def test_a_run_that_may_stop_at_its_first_loss_is_the_same_until_then(tmp_path: Path) -> None:
    dark = ("--trajectory", "office", "--blackout-start-s", "2", "--blackout-end-s", "3")
    sequence = make_sequence(tmp_path / "walk", 5, *dark)
    found = {}
    for name, text in (
        ("whole", EXPERIMENT),
        ("stopped", EXPERIMENT.replace("fps: 10}}", "fps: 10, stop_at_first_loss: true}}")),
    ):
        (tmp_path / name).mkdir()
        plan = plan_of(write_experiment(tmp_path / name, sequence, runs=1, text=text))
        folder = make(plan, tmp_path / name / "x", plan.specs, jobs=2, features=tmp_path / "f")
        for spec in plan.specs:
            found[name, spec.label] = folder.runs / spec.run_key
    for label in ("alone", "offloaded"):
        whole, stopped = (
            pd.read_parquet(found[name, label] / "events.parquet") for name in ("whole", "stopped")
        )
        (loss_ns,) = stopped.loc[stopped["type"] == "track_lost", "t_ns"]
        assert loss_ns == whole.loc[whole["type"] == "track_lost", "t_ns"].iloc[0]
        frames = whole[(whole["type"] == "frame_tracked") & (whole["t_ns"] <= loss_ns)]
        assert list(stopped.loc[stopped["type"] == "frame_tracked", "t_ns"]) == list(frames["t_ns"])
        assert len(frames) < (whole["type"] == "frame_tracked").sum()


def test_another_seed_is_another_run(plan: Plan, tmp_path: Path) -> None:
    """The comparison above can detect differences."""
    folder = make(plan, tmp_path / "x", plan.specs, jobs=2, features=tmp_path / "features")
    for label in ("alone", "offloaded"):
        costs = [
            tuple(events.loc[events["name"] == "track", "wall_ms"])
            for spec in plan.specs
            if spec.label == label
            for events in [pd.read_parquet(folder.runs / spec.run_key / "events.parquet")]
        ]
        assert len(costs) == 2 and costs[0] != costs[1]
