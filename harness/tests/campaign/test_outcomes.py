# SPDX-License-Identifier: Apache-2.0
"""Crashes of a system in some runs are reported completely and everywhere."""

from pathlib import Path

import pandas as pd
from harness_parts import stand_in_sim, virtual_spec
from virtual_parts import Quiet

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.processes import ProcessExecutor
from slambed.campaign.runner import Runner
from slambed.report.experiment import terminal_summary, write_report

RUNS = 40
CRASHES = 12
"""Seeds that are 0, 3 or 6 modulo 10: three runs in ten."""


def test_a_system_that_crashes_in_three_runs_of_ten_is_reported_everywhere(tmp_path: Path) -> None:
    (tmp_path / "sequence").mkdir()
    folder = ResultFolder(tmp_path / "results" / "tiny")
    folder.create()
    played = {"room": (tmp_path / "sequence", 0.5)}
    executor = ProcessExecutor(played, stand_in_sim(tmp_path), None, 2)
    todo = [virtual_spec(seed=n, repetition=n, params={"sim_act": "some"}) for n in range(RUNS)]
    verdict = Runner(folder, Ledger(folder.path / "ledger.jsonl"), executor).run(todo, Quiet())
    assert (verdict.done, verdict.valid, verdict.not_completed) == (RUNS, RUNS, CRASHES)
    # None of them is repeated, now or by a later campaign.
    assert {folder.state(spec.run_key) for spec in todo} == {"valid"}
    assert {folder.store.attempts_of(spec.run_key) for spec in todo} == {1}
    runs = [{"run_key": s.run_key, **s.model_dump(mode="json")} for s in todo]
    folder.write_json("experiment.json", {"experiment": {"id": "tiny"}, "runs": runs})
    folder.close()

    paths = write_report(folder.path, figures=False)
    table = pd.read_csv(paths.summary_csv)
    died = table[table["outcome"] == "died"]
    assert len(table) == RUNS and len(died) == CRASHES
    assert died["coverage"].eq(0).all() and died["not_completed"].all()
    assert died["outcome_reason"].str.contains("signal 11").all()
    page = paths.markdown.read_text()
    assert f"{RUNS} valid, {CRASHES} of them did not complete" in page
    assert f"{CRASHES} of {RUNS} runs died: slambed-sim: signal 11" in page
    cells = pd.read_csv(folder.path / "report" / "tables" / "cells_1.csv")
    (share,) = (name for name in cells.columns if name.startswith("runs that did not complete"))
    # 30 % with Wilson's interval for 12 of 40.
    assert str(cells[share].iloc[0]).startswith("30 [18, 45]")
    terminal_summary(folder.path)


def test_a_run_that_writes_too_much_is_a_result_and_the_campaign_goes_on(tmp_path: Path) -> None:
    (tmp_path / "sequence").mkdir()
    folder = ResultFolder(tmp_path / "results" / "tiny")
    folder.create()
    executor = ProcessExecutor(
        {"room": (tmp_path / "sequence", 0.5)}, stand_in_sim(tmp_path), None, 1
    )
    acts = ("flood", "play")
    todo = [virtual_spec(cell=act, params={"sim_act": act}, max_run_mb=20) for act in acts]
    verdict = Runner(folder, Ledger(folder.path / "ledger.jsonl"), executor).run(todo, Quiet())
    assert (verdict.done, verdict.valid, verdict.not_completed) == (2, 2, 1)
    summaries = [folder.store.summary(spec.run_key) for spec in todo]
    assert [summary and summary["outcome"] for summary in summaries] == ["died", "completed"]
    assert summaries[0] and "more than 20 MiB" in str(summaries[0]["outcome_reason"])
    assert [folder.store.attempts_of(spec.run_key) for spec in todo] == [1, 1]
    kept = sum(path.stat().st_size for path in folder.store.runs.rglob("*") if path.is_file())
    assert kept < 20 << 20, "the store must not keep what filled the disk"
    folder.close()
