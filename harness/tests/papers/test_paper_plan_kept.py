# SPDX-License-Identifier: Apache-2.0
"""Power and cost of campaigns, and whether results keep to their plan."""

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from test_compare import PAPER_ENHANCED, table_2
from typer.testing import CliRunner

from slambed.commands.papers import app
from slambed.papers.compare import compare_paper
from slambed.papers.lookup import pool_of
from slambed.papers.power import costs, ordering_powers, seconds_per_run
from slambed.papers.published import Paper, read_papers
from slambed.papers.published.paper_plan import (
    PaperPlan,
    PlannedLater,
    PlannedRuns,
    ReplacedPlan,
    frozen_digest,
    plans_of_today,
    read_plan,
)
from slambed.papers.registered import plan_lines, plan_words
from slambed.report.load import Results

WRITTEN = datetime(2026, 5, 1, tzinfo=UTC)


@pytest.fixture(scope="module")
def dynnetslam() -> Paper:
    return read_papers(["dynnetslam"])[0]


def plan_of(paper: Paper, **more: Any) -> PaperPlan:
    runs = [PlannedRuns(experiment="made_up", runs=10, seed=1, decides=["dynnet.O04"])]
    return PaperPlan(
        paper=paper.id,
        written_utc=WRITTEN,
        engine="virtual",
        devices={"mobile": "pi"},
        fits=[],
        frozen=frozen_digest(paper),
        data={},
        runs=runs,
    ).model_copy(update=more)


def results(
    started: str = "2026-05-02T00:00:00Z",
    seed: int = 1,
    runs: int = 10,
    plan: PaperPlan | None = None,
) -> Results:
    """Returns runs as made under a plan."""
    lost = [min(n, runs) for n in PAPER_ENHANCED]
    found = table_2({"static": lost}, runs, engine="virtual", device_mobile="pi")
    found.runs["started_utc"] = started
    if plan is not None:
        found.runs["plan.dynnetslam"] = plan.digest
        found.runs["plan_frozen.dynnetslam"] = plan.frozen
    found.spec["seed"] = seed
    return found


def bad(paper: Paper, plan: PaperPlan | None, found: Results) -> list[str]:
    column = compare_paper(paper, pool_of([found]), []).columns[0]
    return [line.text for line in plan_lines(paper, plan, column, [found]) if line.bad]


def test_runs_that_keep_to_their_plan(dynnetslam: Paper) -> None:
    plan = plan_of(dynnetslam)
    good = results(plan=plan)
    assert bad(dynnetslam, plan, good) == []
    column = compare_paper(dynnetslam, pool_of([good]), []).columns[0]
    lines = plan_lines(dynnetslam, plan, column, [good])
    assert plan.digest in lines[0].text
    assert plan_words(lines, plan).endswith("kept")
    assert plan_words([], None) == "no plan"


def test_runs_that_two_experiments_have_in_common_count_for_both(dynnetslam: Paper) -> None:
    both = [
        PlannedRuns(experiment=name, runs=10, seed=1, decides=["dynnet.O04"])
        for name in ("made_up", "made_up_too")
    ]
    plan = plan_of(dynnetslam, runs=both)
    first = results(plan=plan)
    second = replace(first, folder=first.folder.with_name("made_up_too"))
    column = compare_paper(dynnetslam, pool_of([first, second]), []).columns[0]
    assert len(column.runs) == len(first.runs)
    lines = plan_lines(dynnetslam, plan, column, [first, second])
    assert [line.text for line in lines if line.bad] == []


def test_what_was_not_as_planned_is_reported(dynnetslam: Paper) -> None:
    plan = plan_of(dynnetslam)
    assert bad(dynnetslam, plan, results("2026-04-30T23:59:59Z", plan=plan)) == [
        "50 of 50 runs were made before the plan was written."
    ]
    other_seed = results(seed=2, plan=plan)
    assert bad(dynnetslam, plan, other_seed) == ["made_up: seed 2, 1 was planned."]
    fewer = results(runs=6, plan=plan)
    assert bad(dynnetslam, plan, fewer) == ["made_up: 6 runs of a combination, 10 were planned."]
    whole_missing = replace(results(plan=plan), expected=60)
    assert bad(dynnetslam, plan, whole_missing) == ["made_up: 50 of 60 runs of it are there."]
    one = results(runs=1, plan=plan)
    assert bad(dynnetslam, plan, one) == ["made_up: 1 run of a combination, 10 were planned."]
    column = compare_paper(dynnetslam, pool_of([one]), []).columns[0]
    words = plan_words(plan_lines(dynnetslam, plan, column, [one]), plan)
    assert words.endswith("(1 thing not as planned)")
    more = PlannedRuns(experiment="not_begun", runs=30, seed=1, decides=["dynnet.O05"])
    wanted = plan_of(dynnetslam, runs=[*plan.runs, more])
    assert bad(dynnetslam, wanted, results(plan=wanted)) == [
        "not_begun: nothing played, 30 runs per combination were planned."
    ]
    unused = results(plan=wanted)
    unused.folder = unused.folder.with_name("not_begun")
    unused.runs["run_key"] = "other" + unused.runs["run_key"]
    lines = plan_lines(dynnetslam, wanted, column, [one, unused])
    assert lines[-1].text == "not_begun: played, but no number could be taken from its runs."
    other = plan_of(dynnetslam, devices={"mobile": "jetson"})
    reported = bad(dynnetslam, other, results(plan=other))
    assert reported == ["The mobile was pi in 50 of 50 runs (made_up), jetson was planned."]
    live = plan_of(dynnetslam, engine="live")
    assert "The plan is for live runs" in bad(dynnetslam, live, results(plan=live))[0]
    unnamed = results(plan=plan)
    unnamed.runs["started_utc"] = None
    assert bad(dynnetslam, plan, unnamed) == ["50 of 50 runs do not say when they were made."]


def test_runs_name_the_plan_that_they_were_executed_under(dynnetslam: Paper) -> None:
    plan = plan_of(dynnetslam)
    # The plan was rewritten after the results, with its old date.
    fewer = [PlannedRuns(experiment="made_up", runs=5, seed=1, decides=["dynnet.O04"])]
    rewritten = plan_of(dynnetslam, runs=fewer)
    assert bad(dynnetslam, rewritten, results(plan=plan)) == [
        f"50 of 50 runs were made under another plan ({plan.digest})."
    ]
    assert bad(dynnetslam, plan, results()) == [
        "50 of 50 runs do not say under which plan they were made."
    ]
    # Half of the runs come from a campaign before the plan.
    mixed = results(plan=plan)
    mixed.runs.loc[: len(mixed.runs) // 2 - 1, "plan.dynnetslam"] = None
    assert bad(dynnetslam, plan, mixed)[0].startswith("25 of 50 runs do not say")
    # The mapping was changed for the runs and restored afterwards.
    bent = results(plan=plan)
    bent.runs["plan_frozen.dynnetslam"] = "0" * 16
    assert "with another mapping than the plan's" in bad(dynnetslam, plan, bent)[0]
    # One cause is reported once: this plan was rewritten after the runs and names the change.
    later = plan_of(dynnetslam, written_utc=datetime(2026, 6, 1, tzinfo=UTC), runs=fewer)
    story = (
        "50 of 50 runs were made before the plan was written and under another plan "
        f"({plan.digest}): the plan was written anew after them."
    )
    assert bad(dynnetslam, later, results(plan=plan)) == [story]
    known = later.model_copy(
        update={"replaces": ReplacedPlan(plan=plan.digest, why="Fewer runs are asked for")}
    )
    assert known.digest == later.digest
    assert bad(dynnetslam, known, results(plan=plan)) == [f"{story} Fewer runs are asked for."]
    assert bad(dynnetslam, known, results(plan=plan_of(dynnetslam, fits=["a"])))[0].endswith(
        "written anew after them."
    )
    assert bad(dynnetslam, None, results(plan=plan)) == [
        f"50 of 50 runs were made under a plan that is gone: {plan.digest}."
    ]
    assert bad(dynnetslam, None, results()) == []


def test_runs_that_the_plan_waited_for_are_as_planned(dynnetslam: Paper) -> None:
    every = [contrast.id for contrast in dynnetslam.contrasts]
    live = PlannedLater(decides=every, runs=10, waits_for="virtual runs")
    plan = plan_of(dynnetslam, engine="live", runs=[], later=[live])
    good = results(plan=plan)
    assert bad(dynnetslam, plan, good) == []
    column = compare_paper(dynnetslam, pool_of([good]), []).columns[0]
    texts = [line.text for line in plan_lines(dynnetslam, plan, column, [good])]
    assert "made_up is what the plan waited for: virtual runs." in texts
    fewer = results(runs=6, plan=plan)
    assert bad(dynnetslam, plan, fewer) == ["made_up: 6 runs of a combination, 10 were planned."]
    # Runs that another ordering uses, too, are of no `later`.
    some = plan_of(dynnetslam, engine="live", runs=[], later=[])
    reported = bad(dynnetslam, some, results(plan=some))
    assert reported[0] == "The plan is for live runs, not virtual ones."
    assert "Experiment made_up is not in the plan." in reported


def test_cells_that_no_number_is_of_are_not_counted(dynnetslam: Paper) -> None:
    """Runs with another codec, or of a variant that the paper does not have, decide nothing."""
    plan = plan_of(dynnetslam)
    good = results(plan=plan)
    other = good.runs.groupby("cell").head(2).copy()
    other["run_key"] = other["run_key"] + "other"
    other["cell"] = other["cell"] + " other"
    other["variant"] = "nobodys"
    more = replace(good, runs=pd.concat([good.runs, other], ignore_index=True))
    assert bad(dynnetslam, plan, more) == []
    few = good.runs.groupby("cell").head(6)
    assert bad(dynnetslam, plan, replace(good, runs=few)) == [
        "made_up: 6 runs of a combination, 10 were planned."
    ]


def test_a_margin_changed_after_the_plan_is_noticed(dynnetslam: Paper) -> None:
    plan = plan_of(dynnetslam)
    wider = dynnetslam.margins["track_loss_ratio"].model_copy(update={"points": 25.0})
    paper = dynnetslam.model_copy(
        update={"margins": dynnetslam.margins | {"track_loss_ratio": wider}}
    )
    assert ["changed after the plan" in line for line in bad(paper, plan, results(plan=plan))] == [
        True
    ]


def test_what_is_registered_today_goes_into_manifests(dynnetslam: Paper) -> None:
    plan = read_plan("dynnetslam")
    assert plan is not None
    reported = {"plan": plan.digest, "frozen": frozen_digest(dynnetslam)}
    assert plans_of_today()["dynnetslam"] == reported


def test_powers_are_those_of_the_printed_numbers(dynnetslam: Paper) -> None:
    table = ordering_powers(dynnetslam, (10, 30))
    assert "spread assumed, 20% of a mean; a page takes that of its runs" in table.caption
    rows = {row[0]: row for row in table.rows}
    assert float(rows["dynnet.O03"][2]) == pytest.approx(0.14, abs=0.04)
    assert float(rows["dynnet.O03"][3]) == pytest.approx(0.92, abs=0.04)
    assert rows["dynnet.O03"][4] == "30"
    assert rows["dynnet.O09"][5].startswith("NO")  # 3 against 11 of 100 is not significant
    assert rows["dynnet.O11"][2:] == ["-", "-", "-", "in words only"]


def test_costs_are_measured_where_a_ledger_is(dynnetslam: Paper, tmp_path: Path) -> None:
    ledger = tmp_path / "d_t2_rtt" / "ledger.jsonl"
    ledger.parent.mkdir()
    entries = [
        {"event": "run_finished", "time_utc": f"2026-05-01T{hour:02}:00:{6 * n:02}+00:00"}
        for hour in (0, 5)
        for n in range(8)
    ]
    ledger.write_text("\n".join(map(json.dumps, entries)) + "\n")
    assert seconds_per_run(ledger) == pytest.approx(6.0)
    assert seconds_per_run(tmp_path / "none.jsonl") is None
    ledger.write_text("torn {")
    assert seconds_per_run(ledger) is None
    # A killed campaign leaves half a line between complete ones.
    ledger.write_text("\n".join(["torn {", *map(json.dumps, entries)]) + "\n")
    assert seconds_per_run(ledger) == pytest.approx(6.0)
    sizes = {"d_t2_rtt": (10, 5, 87.0), "d_t3_sine": (28, 3, 87.0)}
    table = costs(dynnetslam, sizes, None, tmp_path, jobs=2)
    assert table.rows == [
        ["d_t2_rtt", "10", "5", "50", "5", "measured here"],
        ["d_t3_sine", "28", "3", "84", "6", "assumed"],
    ]


def test_the_command_reports_power_and_cost(tmp_path: Path) -> None:
    shown = CliRunner().invoke(app, ["power", "multithread_rl", "--results", str(tmp_path)])
    assert shown.exit_code == 0, shown.output
    assert "Chance that an ordering holds" in shown.output
    assert "Table 4" in shown.output
    listed = CliRunner().invoke(app, ["list"])
    assert "dynnetslam: DynNetSLAM" in listed.output
