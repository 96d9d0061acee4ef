# SPDX-License-Identifier: Apache-2.0
"""Reports name the kind of their runs: virtual, in two groups, failing, none at all."""

import html
import json
import re
from pathlib import Path

import pandas as pd
import pytest
from results_factory import RawRun, spec_of, write_experiment

from slambed.errors import SlambedError
from slambed.report import plots
from slambed.report.cells import Cell, cells_of, metrics_to_show, what_runs_show
from slambed.report.experiment import write_report
from slambed.report.load import load
from slambed.report.timeline import timeline_svg
from slambed.spec.faults import Fault


def test_an_empty_experiment_says_nothing_was_measured(tmp_path: Path) -> None:
    (tmp_path / "nothing").mkdir()
    paths = write_report(tmp_path / "nothing")
    assert "nothing was measured" in paths.problems[0]
    assert "Nothing was measured." in paths.html.read_text()
    with pytest.raises(SlambedError, match="not a folder"):
        write_report(tmp_path / "no_such_place")


def test_virtual_runs_pass_for_nothing_measured(tmp_path: Path) -> None:
    link = {"backend": "virtual", "profile": "ramp_85"}
    spec = spec_of("edgeslam", "static", "ramp_85", 0, engine="virtual", link=link)
    run = RawRun(duration_s=6.0, manifest={"limits": {}})
    experiment = write_experiment(tmp_path, [(spec, run)])
    (folder,) = (experiment / "runs").iterdir()
    log = pd.read_parquet(folder / "link.parquet")
    log[log["series"] != "probe_rtt_ms"].to_parquet(folder / "link.parquet")
    values = json.loads((folder / "summary.json").read_text())
    values |= dict.fromkeys([key for key in values if key.startswith("rtt_")])
    (folder / "summary.json").write_text(json.dumps(values))
    devices = {"mobile": {"device": "host", "name": "half_core", "cores": 1, "speed": 0.5}}
    content = {"experiment": {"title": "Virtual", "devices": devices}}
    (experiment / "experiment.json").write_text(json.dumps(content))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plots, "keys_for", lambda _: [])
        write_report(experiment)
    for text in (
        (experiment / "report" / "index.html").read_text(),
        (experiment / "report.md").read_text(),
    ):
        assert "Engine virtual: simulated time" in text
        assert "mobile half_core (what if: host with 1 core, 0.5 times its speed)" in text
        assert "set in the modeled link" in text and "measured by echoes" not in text
        assert "0/1" not in text and "No limits were recorded" not in text
        assert "Virtual runs have no limits" in text
    figure = (experiment / "report" / "rtt_room_walk_ramp_85.svg").read_text()
    assert "<!-- latency set, both ways -->" in figure and "<!-- message up, one way -->" in figure
    assert "<!-- measured -->" not in figure


def test_two_groups_of_runs_are_shown_not_averaged_away(tmp_path: Path) -> None:
    runs = [
        (
            spec_of("orbslam2", "default", None, i),
            RawRun(duration_s=4, edge=False, noise_m=0.1 if i % 3 == 0 else 0.01, seed=i),
        )
        for i in range(12)
    ]
    results = load(write_experiment(tmp_path, runs))
    cell = cells_of(results, metrics_to_show(results))[0]
    assert any("ATE RMSE: two groups, 8 runs near" in note for note in cell.notes), cell.notes


def test_a_cell_without_survivors_has_no_accuracy_of_others(tmp_path: Path) -> None:
    runs = [
        (
            spec_of("orbslam2", "default", None, i),
            RawRun(duration_s=6, edge=False, seed=i, lost_at_s=((2.0, 6.0),)),
        )
        for i in range(2)
    ]
    results = load(write_experiment(tmp_path, runs))
    (cell,) = cells_of(results, metrics_to_show(results))
    (note,) = [note for note in cell.notes if "tracked less than" in note]
    assert note.startswith("2 of 2 runs tracked less than 90% of their frames; their ATE")
    assert "others" not in note and " - " not in note


def test_failures_stand_beside_the_survivors_accuracy(tmp_path: Path) -> None:
    runs = [
        (
            spec_of("orbslam2", "default", None, i),
            RawRun(duration_s=6, edge=False, seed=i, lost_at_s=((2.0, 6.0),) if i < 3 else ()),
        )
        for i in range(5)
    ]
    results = load(write_experiment(tmp_path, runs))
    cell = cells_of(results, metrics_to_show(results))[0]
    note = next(note for note in cell.notes if "tracked less than" in note)
    assert note.startswith("3 of 5 runs")
    assert "the median run failed" in note
    shown = [item.key for item in metrics_to_show(results)]
    assert shown[shown.index("ate_rmse_m") + 1] == "failed"
    assert cell.values["failed"].value == 0.6


def test_a_failed_run_without_a_short_path_is_not_said_to_have_one(tmp_path: Path) -> None:
    runs = [
        (
            spec_of("orbslam2", "default", None, i),
            RawRun(duration_s=6, edge=False, seed=i, lost_at_s=((2.0, 6.0),) if i < 2 else ()),
        )
        for i in range(7)
    ]
    results = load(write_experiment(tmp_path, runs))
    results.runs.loc[results.runs.index[2], "ate_rmse_m"] = None
    results.runs.loc[results.runs.index[3], "coverage"] = None
    (cell,) = cells_of(results, metrics_to_show(results))
    (note,) = [note for note in cell.notes if "ATE" in note]
    assert note.startswith(
        "2 of 7 runs tracked less than 90% of their frames, 1 of 7 runs without an ATE, "
        "1 of 7 runs without a coverage; ATE of the others "
    )
    results.runs.loc[results.runs.index[4:], "ate_rmse_m"] = None
    (cell,) = cells_of(results, metrics_to_show(results))
    (note,) = [note for note in cell.notes if "ATE" in note]
    assert "4 of 7 runs without an ATE, 1 of" in note and note.endswith("of what they tracked")


@pytest.mark.parametrize(
    ("valid", "words"),
    [
        ((10, 10, 0), "of 10 unpaired runs a side"),
        ((10, 4, 0), "of 4 unpaired runs a side"),
        ((10, 0), ""),
        ((0, 0), ""),
        ((10,), ""),
        ((1, 1, 1), "One run per combination shows nothing"),
    ],
)
def test_a_combination_without_a_valid_run_says_nothing_of_the_others(
    valid: tuple[int, ...], words: str
) -> None:
    cells = [Cell(f"c{i}", "a", "room", "none", 10, n, "", {}, []) for i, n in enumerate(valid)]
    found = what_runs_show(cells)
    assert words in found and bool(found) == bool(words)


def test_without_failures_no_column_is_about_them(tmp_path: Path) -> None:
    runs = [(spec_of("orbslam2", "default", None, i), RawRun(4, edge=False)) for i in range(2)]
    results = load(write_experiment(tmp_path, runs))
    assert "failed" not in {item.key for item in metrics_to_show(results)}


def test_a_metric_that_no_run_has_is_named_with_the_reason(tmp_path: Path) -> None:
    folder = write_experiment(tmp_path, [(spec_of("orbslam2", "default", None, 0), RawRun(4.0))])
    asked = ["coverage", "ate_rmse_m", "rpe_trans_m", "update_wait_ms_median", "first_loss_s"]
    report = {"metrics": [*asked, "keyframes_sent", "faults", "not_completed"]}
    content = {"experiment": {"title": "T", "report": report}}
    (folder / "experiment.json").write_text(json.dumps(content))
    (file,) = folder.glob("runs/*/summary.json")
    summary = json.loads(file.read_text())
    without = {"ate_rmse_m": None, "rpe_trans_m": None, "groundtruth": None}
    file.write_text(json.dumps(summary | without))
    expected = [
        "ate_rmse_m, rpe_trans_m: asked for, but no run has a ground truth",
        "update_wait_ms_median: asked for, but no run has a value, and none has an edge "
        "(T_Wait: the pacing of updates (`sync_period_s`))",
        "first_loss_s: asked for, but no run lost track",
        "keyframes_sent: asked for, but no system of these runs reports it",
    ]
    paths = write_report(folder, figures=False)
    assert [line for line in paths.problems if "asked for" in line] == expected
    assert all(html.escape(line) in paths.html.read_text() for line in expected)
    (events,) = folder.glob("runs/*/events.parquet")
    events.unlink()
    file.write_text(json.dumps(summary | without | {"metrics_version": "1"}))
    assert (
        "update_wait_ms_median: asked for, but the numbers are of an older version, "
        "and no run has events to compute it from"
    ) in write_report(folder, figures=False).problems


def test_what_only_live_runs_measure_is_named_so(tmp_path: Path) -> None:
    spec = spec_of("orbslam2", "default", None, 0, engine="virtual")
    folder = write_experiment(tmp_path, [(spec, RawRun(4.0, edge=False))])
    asked = {"metrics": ["rtt_error_ms_median", "host_stall_ms_max", "coverage"]}
    content = {"experiment": {"title": "T", "report": asked}}
    (folder / "experiment.json").write_text(json.dumps(content))
    report = write_report(folder, figures=False)
    assert report.problems == []
    line = "Only live runs measure rtt_error_ms_median, host_stall_ms_max."
    assert line in report.markdown.read_text() and line in report.html.read_text()


def test_a_report_reports_the_faults_of_its_runs(tmp_path: Path) -> None:
    freeze = Fault(at_s=2, edge="freeze", for_s=1.5)
    kill = Fault(at_s=3, edge="kill")
    runs = [
        (
            spec_of("edgeslam", "static", "none", 0, label=label, cell=f"{label}/room_walk/none"),
            RawRun(duration_s=4, faults=faults),
        )
        for label, faults in (("plain", ()), ("frozen", (freeze,)), ("killed", (kill,)))
    ]
    folder = write_experiment(tmp_path, runs)
    content = {"experiment": {"title": "Faults", "report": {"metrics": ["faults", "keyframes"]}}}
    (folder / "experiment.json").write_text(json.dumps(content))
    paths = write_report(folder, figures=False)
    assert paths.problems == []
    for text in (paths.markdown.read_text(), paths.html.read_text()):
        assert "faults [s]" in text and "freeze 2.0-3.5" in text and "kill 3.0-" in text
    rows = pd.read_csv(folder / "report" / "tables" / "cells_1.csv").set_index("system")
    assert rows["faults [s]"].to_dict() == {
        "plain": "-",
        "frozen": "freeze 2.0-3.5",
        "killed": "kill 3.0-",
    }
    results = load(folder)
    assert metrics_to_show(results)[0].key == "keyframes"
    shades = {
        key: [float(w) for w in re.findall(r'class="fault".*?width="([\d.]+)%"', timeline)]
        for key in results.runs["run_key"]
        if (timeline := timeline_svg(results, key)) is not None
    }
    ends = results.runs.set_index("label")["run_key"]
    assert shades[ends["plain"]] == []
    (frozen,), (killed,) = shades[ends["frozen"]], shades[ends["killed"]]
    assert 1.2 < frozen / killed < 1.8  # 1.5 s, and about one to the end
