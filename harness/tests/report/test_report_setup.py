# SPDX-License-Identifier: Apache-2.0
"""What a report tells about the basis of its numbers: compute times, settings, alignment, runs."""

import html
import io
import json
import re
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from path_files import write_path
from results_factory import RawRun, room_walk, spec_of, write_experiment
from rich.console import Console

from slambed.commands.explain import find_run
from slambed.data.trajectory import Trajectory, read_tum
from slambed.explain.view import view_of, write_png
from slambed.report.compute_times import ComputeTime, compute_times
from slambed.report.conditions import conditions_of
from slambed.report.differences import LINKS, difference_table, differences
from slambed.report.experiment import terminal_summary, write_report
from slambed.report.figures.changes import draw_changes
from slambed.report.figures.paths import draw_paths
from slambed.report.load import load
from slambed.report.settings import settings_table
from slambed.report.setup import setup_lines
from slambed.report.style import FigureWriter, figure, from_zero_if_it_shows, legend_beneath
from slambed.report.truth import truth_table
from slambed.serve.experiment_view import LoadedExperiment

PI = {"name": "raspberry_pi_4"}


def on_a_pi(root: Path, track_ms: float, **more: object) -> Path:
    spec = spec_of("orbslam2", "default", None, 0, **{"device_mobile": PI, **more})
    run = RawRun(duration_s=4.0, edge=False, track_ms=track_ms, manifest={"limits": {}})
    return write_experiment(root, [(spec, run)])


def setup_of(folder: Path) -> list[str]:
    results = load(folder)
    return setup_lines(results, compute_times(results))


def test_a_device_that_is_two_machines_is_said_to_be(tmp_path: Path) -> None:
    fast, slow = on_a_pi(tmp_path / "a", 5.0), on_a_pi(tmp_path / "b", 40.0)
    (live,) = compute_times(load(fast))
    assert live.ran_ms == pytest.approx(5.0, rel=0.1)
    assert live.ratio == pytest.approx(8.1, rel=0.1)
    (line,) = [line for line in setup_of(fast) if "Compute times" in line]
    assert f"take {live.ran_ms:.1f} ms (orbslam2) per frame" in line
    assert f"its cost model charges {live.model_ms:.1f} ms" in line and "two machines" in line
    assert "two machines" not in " ".join(setup_of(slow))
    virtual = on_a_pi(tmp_path / "c", 40.0, engine="virtual")
    assert "are those of its cost model" in " ".join(setup_of(virtual))


def test_a_footnote_names_packages_files_and_host(tmp_path: Path) -> None:
    theirs = spec_of(
        "orb_slam3", "default", None, 0, runtime={"mobile": {"command": ["python3", "run.py"]}},
        params={"vocabulary": "/somewhere/ORBvoc.txt"}, inputs={"vocabulary": "0123456789abcdef"},
    )  # fmt: skip
    host = {"cores": 4, "cpu_model": "Invented 4000"}
    packages = {"python_packages": {"pyorbslam3": "0.1.1", "numpy": "2.2.6"}}
    of_theirs = RawRun(duration_s=4.0, edge=False, manifest=host | packages)
    ours = spec_of("orbslam2", "default", None, 0, inputs={"prior_map": "fedcba9876543210"})
    of_ours = RawRun(duration_s=4.0, edge=False, manifest=host)
    folder = write_experiment(tmp_path, [(theirs, of_theirs), (ours, of_ours)])
    named = (
        "orb_slam3 runs with pyorbslam3 0.1.1, numpy 2.2.6; "
        "vocabulary ORBvoc.txt (SHA-256 0123456789ab)."
    )
    lines = setup_of(folder)
    assert [line for line in lines if " runs with " in line] == [named]
    assert "Host: 4 cores of Invented 4000." in lines
    terminal = Console(width=400, record=True, file=io.StringIO())
    terminal_summary(folder, terminal)
    assert named in terminal.export_text()


def test_several_hosts_are_named_with_their_runs(tmp_path: Path) -> None:
    def run(repetition: int, cpu: str | None, engine: str = "local") -> tuple[object, RawRun]:
        facts = {"cores": 1 if cpu == "A" else 2, "cpu_model": cpu} if cpu else {"cpu_model": None}
        spec = spec_of("orbslam2", "default", None, repetition, engine=engine)
        return spec, RawRun(duration_s=4.0, edge=False, manifest=facts)

    folder = write_experiment(
        tmp_path, [run(0, "A"), run(1, "B"), run(2, "B"), run(3, "C", "virtual")]
    )
    assert "Host: 1 core of A (1 run); 2 cores of B (2 runs)." in setup_of(folder)
    one = write_experiment(tmp_path / "one", [run(0, "A"), run(1, None)])
    assert "Host: 1 core of A (1 run)." in setup_of(one)


def test_two_versions_of_a_package_are_told_with_their_runs(tmp_path: Path) -> None:
    def run(repetition: int, version: str) -> tuple[object, RawRun]:
        runtime = {"mobile": {"command": ["python3", "run.py"]}}
        spec = spec_of("theirs", "default", None, repetition, runtime=runtime)
        packages = {"python_packages": {"a": version}} if version else {}
        return spec, RawRun(duration_s=4.0, edge=False, manifest=packages)

    folder = write_experiment(tmp_path, [run(0, "1.0"), run(1, "1.0"), run(2, "2.0"), run(3, "")])
    lines = [line for line in setup_of(folder) if " runs with " in line]
    assert lines == [
        "theirs runs with a 1.0 in 2 of 4 runs.",
        "theirs runs with a 2.0 in 1 of 4 runs.",
    ]


def test_a_system_that_nothing_can_hold_up_is_not_told_to_be_held_up() -> None:
    known = ComputeTime("raspberry_pi_4", False, False, 5.0, False, 40.0)
    assert "--set pace=device" in str(known.warning("mine"))
    beside = str(replace(known, unknown=("my SLAM",)).warning("mine"))
    assert "--set pace" not in beside and "my SLAM: no stages are reported" in beside


def test_compute_times_name_their_systems() -> None:
    alone = ComputeTime("raspberry_pi_4", True, False, 4.0, False, None)
    two = replace(alone, known={"orbslam2": 3.1, "edgeslam: static": 4.9})
    assert "take 3.1 ms (orbslam2) and 4.9 ms (edgeslam: static) per frame" in two.line()
    four = replace(two, known={**two.known, "dynnetslam": 4.2, "cloudslam": 3.8})
    assert "take 3.1 to 4.9 ms (4 systems, median 4.0) per frame" in four.line()


@pytest.mark.parametrize(
    ("track_ms", "more", "expected"),
    [
        (5.0, {}, "8.1 times as fast"),
        (40.0, {}, None),
        (100.0, {}, "2.5 times as slow"),
        (5.0, {"engine": "virtual"}, None),
        (5.0, {"pace": "device"}, None),
        (5.0, {"device_mobile": {"name": "half_core"}}, None),  # unknown without a model
    ],
)
def test_a_live_run_far_from_its_device_is_a_loud_warning(
    tmp_path: Path, track_ms: float, more: dict[str, object], expected: str | None
) -> None:
    folder = on_a_pi(tmp_path, track_ms, **more)
    paths = write_report(folder, figures=False)
    terminal = Console(width=400, record=True, file=io.StringIO())
    terminal_summary(folder, terminal)
    page, markdown = paths.html.read_text(), paths.markdown.read_text()
    texts = (
        html.unescape(page),
        markdown,
        terminal.export_text(),
        *LoadedExperiment.of(folder).results.problems,
    )
    found = [text for text in texts if "its cost model says" in text]
    if expected is None:
        assert not found
        return
    assert len(found) == 4
    ran_ms = compute_times(load(folder))[0].ran_ms
    for text in found:
        assert re.search(
            rf"on raspberry_pi_4 are {expected[:2]}\S* {expected[4:]} as the device", text
        )
        assert f"took {ran_ms:.1f} ms per frame (measured), its cost model says 4" in text
        assert ("pace: device" in text) == ("fast" in expected)
        assert ("--engine virtual" in text) == ("slow" in expected)
    # It comes before all numbers and is styled as a warning.
    assert page.index('<p class="warn"><b>Warning: live runs') < page.index('<div class="tiles">')
    assert markdown.index("**Warning: live runs") < markdown.index("Engine local")


def test_truth_says_how_far_apart_the_compute_times_are(tmp_path: Path) -> None:
    live, virtual = on_a_pi(tmp_path / "a", 5.0), on_a_pi(tmp_path / "b", 40.0, engine="virtual")
    caption = truth_table(load(live), load(virtual)).caption
    assert "raspberry_pi_4 is two machines" in caption and "times)" in caption
    same = on_a_pi(tmp_path / "c", 40.0)
    assert "is one machine" in truth_table(load(same), load(virtual)).caption


def test_settings_that_differ_between_systems_are_reported(tmp_path: Path) -> None:
    short = RawRun(duration_s=3.0)
    runs = [
        (spec_of(system, variant, "ramp_85", 0, params=params), short)
        for system, variant, params in (
            ("edgeslam", "static", {"loop_closing": True, "n_orb": 750, "n_kf": 1}),
            ("dynnetslam", "wh_wsz", {"loop_closing": False, "n_orb": 750, "l_ol_ms": 40.0}),
        )
    ]
    table = settings_table(load(write_experiment(tmp_path, runs)))
    assert table.headings == ["setting", "dynnetslam:wh_wsz", "edgeslam:static"]
    assert table.rows == [["loop_closing", "false", "true"]]


@pytest.fixture
def one_camera(tmp_path: Path) -> Path:
    """A run whose path is a quarter as large as the ground truth, aligned with scale; the truth is
    known for three times as long."""
    experiment = write_experiment(
        tmp_path, [(spec_of("orbslam2", "default", None, 0), RawRun(duration_s=4.0, edge=False))]
    )
    (run,) = (experiment / "runs").iterdir()
    path = run / "trajectory.txt"
    write_path(path, read_tum(path).scaled(0.25))
    summary = json.loads((run / "summary.json").read_text())
    (run / "summary.json").write_text(json.dumps(summary | {"ate_alignment": "sim3"}))
    truth = experiment / "groundtruth" / "room_walk.txt"
    write_path(truth, room_walk(12.0))
    manifest = json.loads((run / "summary.json").read_text()) | {"groundtruth": None}
    (run / "summary.json").write_text(json.dumps(manifest))
    return experiment


def test_one_camera_is_drawn_with_the_alignment_of_its_number(
    one_camera: Path, tmp_path: Path
) -> None:
    results = load(one_camera)
    writer = FigureWriter(tmp_path / "figures", "", [])
    draw_paths(results, conditions_of(results)[0], writer)
    (saved,) = writer.saved
    assert "with its scale, Sim(3)" in saved.caption
    data = pd.read_csv(writer.folder / saved.data)
    own, true = data[data["run_key"].notna()], data[data["label"] == "ground truth"]
    near = np.searchsorted(true["stamp_s"], own["stamp_s"]).clip(0, len(true) - 1)
    columns = ["x_m", "y_m", "z_m"]
    off = own[columns].to_numpy() - true[columns].to_numpy()[near]
    assert np.median(np.linalg.norm(off, axis=1)) < 0.05


def test_a_view_shows_the_truth_that_was_played(one_camera: Path, tmp_path: Path) -> None:
    view = view_of(find_run("0000", one_camera.parent))
    assert view.truth is not None and isinstance(view.truth, Trajectory)
    assert np.ptp(view.truth.stamps_s) == pytest.approx(3.9, abs=0.2)
    assert view.alignment is not None and view.alignment.scale == pytest.approx(4, rel=0.02)
    assert write_png(view, tmp_path).stat().st_size > 1000


def test_differences_are_about_the_experiments_own_metrics_and_pairs(tmp_path: Path) -> None:
    runs = [
        (
            spec_of(system, variant, "ramp_85", repetition, engine="virtual"),
            RawRun(duration_s=3.0, edge=edge, seed=repetition, track_ms=30 if edge else 40),
        )
        for repetition in range(4)
        for system, variant, edge in (("orbslam2", "default", False), ("edgeslam", "static", True))
    ]
    experiment = write_experiment(tmp_path, runs)
    content = {"experiment": {"report": {"metrics": ["track_ms_p95", "keyframes"]}}}
    (experiment / "experiment.json").write_text(json.dumps(content))
    found = differences(load(experiment), baseline="orbslam2")
    assert [d.metric.key for d in found] == ["track_ms_p95", "keyframes"]
    assert all(d.found.paired and d.found.runs == 4 and not d.possible for d in found)
    assert found[0].found.effect == "higher in 0 of 4 pairs"
    assert found[0].found.change.is_range and found[0].found.change.high < 0
    table = difference_table(found)
    assert {row[-1] for row in table.rows} == {"too few runs to show any"}
    assert "With 4 runs 2 of these 2 comparisons could show no difference" in table.caption
    assert "from 7 runs per combination on they can" in table.caption


def test_enough_pairs_show_a_difference(tmp_path: Path) -> None:
    runs = [
        (
            spec_of(system, variant, "ramp_85", repetition, engine="virtual"),
            RawRun(duration_s=2.0, edge=edge, seed=repetition, track_ms=30 if edge else 40),
        )
        for repetition in range(7)
        for system, variant, edge in (("orbslam2", "default", False), ("edgeslam", "static", True))
    ]
    experiment = write_experiment(tmp_path, runs)
    content = {"experiment": {"report": {"metrics": ["track_ms_median"]}}}
    (experiment / "experiment.json").write_text(json.dumps(content))
    (found,) = differences(load(experiment), baseline="orbslam2")
    assert (found.verdict, found.possible) == ("better", True)
    assert found.p_value == pytest.approx(2 / 2**7)
    assert "could show" not in difference_table([found]).caption


def test_runs_without_an_engine_are_compared_with_each_other(tmp_path: Path) -> None:
    runs = [
        (spec_of(system, "default", "none", repetition), RawRun(duration_s=2.0, seed=repetition))
        for system in ("orbslam2", "edgeslam")
        for repetition in range(2)
    ]
    results = load(write_experiment(tmp_path, runs))
    results.runs["engine"] = None
    assert {(d.baseline, d.other) for d in differences(results)} == {("edgeslam", "orbslam2")}
    results.runs["engine"] = ["virtual", "virtual", float("nan"), None]
    assert differences(results) == []


def test_who_lacks_the_first_one_is_compared_with_its_own_first(tmp_path: Path) -> None:
    places = (
        ("orbslam2", "default", "none"),
        ("edgeslam", "static", "none"),
        ("edgeslam", "static", "ramp_85"),
        ("edgeslam", "conventional", "ramp_85"),
        ("edgeslam", "conventional", "rtt_40"),
    )
    runs = [
        (
            spec_of(system, variant, profile, repetition, engine="virtual"),
            RawRun(duration_s=2.0, edge=system != "orbslam2", seed=repetition),
        )
        for system, variant, profile in places
        for repetition in range(2)
    ]
    experiment = write_experiment(tmp_path, runs)
    static, conventional = "edgeslam:static", "edgeslam:conventional"
    content = {
        "report": {"metrics": ["track_ms_median"]},
        "systems": ["orbslam2", static, conventional],
    }
    (experiment / "experiment.json").write_text(json.dumps({"experiment": content}))
    results = load(experiment)
    found = differences(results)
    assert [(d.under, d.baseline, d.other) for d in found] == [
        ("none", "orbslam2", static), ("ramp_85", static, conventional),
    ]  # fmt: skip
    between_links = differences(results, between=LINKS)
    assert [(d.under, d.baseline, d.other) for d in between_links] == [
        (static, "none", "ramp_85"), (conventional, "ramp_85", "rtt_40"),
    ]  # fmt: skip
    writer = FigureWriter(tmp_path / "figures", "", [])
    draw_changes(found, "room_walk", writer)
    (saved,) = writer.saved
    assert "change against the first system of each link, room_walk" in saved.title
    assert saved.caption.startswith(
        "Each system less the first one of its link (orbslam2 on none, edgeslam:static on ramp_85)"
    )


@pytest.mark.parametrize("all_fail", [False, True])
def test_an_early_loss_is_no_better_accuracy(tmp_path: Path, all_fail: bool) -> None:
    runs = [
        (
            spec_of(system, variant, "ramp_85", repetition, engine="virtual"),
            RawRun(
                duration_s=4.0,
                edge=edge,
                seed=repetition,
                noise_m=0.01 if edge else 0.05,
                lost_at_s=((1.5, 4.0),) if edge or all_fail else (),
            ),
        )
        for repetition in range(7)
        for system, variant, edge in (("orbslam2", "default", False), ("edgeslam", "static", True))
    ]
    experiment = write_experiment(tmp_path, runs)
    content = {"experiment": {"report": {"metrics": ["ate_rmse_m"]}}}
    (experiment / "experiment.json").write_text(json.dumps(content))
    results = load(experiment)
    shown = results.runs.groupby("system")["ate_rmse_m"].median()
    assert shown["edgeslam"] < shown["orbslam2"]
    (found,) = differences(results, baseline="orbslam2")
    if all_fail:  # ranks of failures would show nothing
        assert found.verdict == "better" and found.found.b < found.found.a < 1
        return
    assert found.verdict == "worse" and found.found.b == float("inf")
    row = difference_table([found]).rows[0]
    assert row[6] == "failed" and row[7] == "inf [inf, inf]"


def test_boxes_are_not_squeezed_to_an_edge() -> None:
    with figure() as (_, (axis,)):
        assert not from_zero_if_it_shows(axis, [61.0, 65.0])
        low, high = axis.get_xlim()
        assert 58 < low < 61 and 65 < high < 68
        assert from_zero_if_it_shows(axis, [1.0, 65.0])
        assert axis.get_xlim() == (0, pytest.approx(68.25))
        assert not from_zero_if_it_shows(axis, [7.0, 7.0])
        assert axis.get_xlim()[0] < 7 < axis.get_xlim()[1]


def test_titles_and_legends_stay_inside_the_figure(tmp_path: Path) -> None:
    made: list[Figure] = []
    with figure() as (drawn, (axis,)):
        for i in range(5):
            axis.plot([0, 1], [0, i], label=f"a system with quite a long name {i}")
        axis.set_title("Runs with a track loss against CPU: a_data_set_with_a_name, and a profile")
        legend_beneath(drawn, axis)
        FigureWriter(tmp_path, "", []).save(drawn, "x", "x", "", pd.DataFrame({"a": [1]}))
        made.append(drawn)
        page = drawn.bbox
        for text in (axis.title, *drawn.legends):
            box = text.get_window_extent()
            assert page.x0 <= box.x0 and box.x1 <= page.x1
        assert "\n" in axis.get_title()
        assert not drawn.legends[0].get_window_extent().overlaps(axis.get_tightbbox())
    assert matplotlib.image.imread(tmp_path / "x.png").size > 0
