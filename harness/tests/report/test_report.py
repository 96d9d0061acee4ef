# SPDX-License-Identifier: Apache-2.0
"""Reports from run folders are complete, self-contained, and robust against damage."""

import json
import re
import shutil
from html.parser import HTMLParser
from io import StringIO
from pathlib import Path

import matplotlib.image
import numpy as np
import pandas as pd
import pytest
from command_line import refused, slambed
from results_factory import quickstart_like
from rich.console import Console

from slambed.commands.explain import find_run
from slambed.commands.report_request import FIGURES
from slambed.commands.run_and_report import show_report
from slambed.errors import SlambedError
from slambed.explain.view import view_of, write_png, write_rerun
from slambed.metrics.catalog import SUMMARY_KEYS, keys_for
from slambed.metrics.metric import Use
from slambed.native import repository_root
from slambed.report import plots
from slambed.report.cells import cells_of, metrics_to_show
from slambed.report.differences import difference_tables, differences
from slambed.report.experiment import terminal_summary, write_report, write_tables
from slambed.report.load import load
from slambed.report.page import cell
from slambed.report.tables import Table, cell_tables
from slambed.report.timeline import timeline_svg


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small experiment with its report; two box figures are enough here."""
    folder = quickstart_like(tmp_path_factory.mktemp("q"), 3, 8.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plots, "keys_for", lambda _: ["lost", "ate_rmse_m"])
        paths = write_report(folder)
    assert paths.problems == []
    return folder


@pytest.fixture
def experiment(reported: Path, tmp_path: Path) -> Path:
    """A copy without its report, for tests that damage it."""
    ignore = shutil.ignore_patterns("report", "report.md", "summary.csv")
    shutil.copytree(reported, tmp_path / "invented", ignore=ignore)
    return tmp_path / "invented"


class PageReader(HTMLParser):
    """Collects ids, links and what a browser would fetch, and checks that tags close."""

    VOID = frozenset({"meta", "link", "img", "br", "wbr"})

    def __init__(self) -> None:
        super().__init__()
        self.sources: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if "src" in values:
            self.sources.append(values["src"] or "")
        if "id" in values:
            self.ids.append(values["id"] or "")
        if tag == "a":
            self.links.append(values.get("href") or "")
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_is_self_contained_and_whole(reported: Path) -> None:
    text = (reported / "report" / "index.html").read_text()
    page = PageReader()
    page.feed(text)
    assert page.open == []
    assert all(source.startswith("data:image/") for source in page.sources)
    assert len(page.ids) == len(set(page.ids))
    assert {link[1:] for link in page.links if link.startswith("#")} <= set(page.ids)
    for link in page.links:
        assert link.startswith("#") or (reported / "report" / link).exists(), link
    # The page has its own script and the points of its figures, and fetches nothing.
    assert "<script src" not in text and text.count("<script>") == 1
    assert 'font: 16px/1.45 system-ui, -apple-system, "Segoe UI"' in text  # no escaped quotes
    assert not re.search(r"url\(|@import|https?://(?!www\.w3\.org)", text)
    for word in ("viewport", "@media print", "Link and limits as asked", "Manifest", "Runs"):
        assert word in text


def test_every_figure_has_its_data_its_formats_and_its_command(reported: Path) -> None:
    figures = json.loads((reported / "report" / "figures.json").read_text())
    names = {figure["name"] for figure in figures}
    assert {
        "share_lost", "box_ate_rmse_m", "losses_room_walk_ramp_85", "trajectory_room_walk_ramp_85",
        "rtt_room_walk_ramp_85", "cpu_room_walk_ramp_85", "memory_room_walk_ramp_85",
        "stages_room_walk_ramp_85", "update_delay_room_walk_ramp_85",
        "losses_by_profile_room_walk_edgeslam-static",
    } <= names  # fmt: skip
    for figure in figures:
        assert figure["command"] == "slambed report invented"
        *pictures, points = figure["files"]
        assert {Path(name).suffix for name in pictures} == {".png", ".svg", ".pdf"}
        assert points == f"{figure['name']}.points.json"
        assert len(pd.read_csv(reported / "report" / figure["data"])) > 0
        for name in pictures:
            assert (reported / "report" / name).stat().st_size > 1000
        pixels = matplotlib.image.imread(reported / "report" / f"{figure['name']}.png")
        assert np.ptp(pixels[..., :3]) > 0.5  # something is drawn
        assert "slambed report" in (reported / "report" / f"{figure['name']}.svg").read_text()


def test_losses_figure_counts_runs(reported: Path) -> None:
    data = pd.read_csv(reported / "report" / "losses_room_walk_ramp_85.csv")
    last = data.groupby("label")["runs_lost"].max().to_dict()
    assert last == {"edgeslam:static": 1, "orbslam2": 0}  # every second run loses track at 6 s


def test_trajectory_figure_is_aligned(reported: Path) -> None:
    data = pd.read_csv(reported / "report" / "trajectory_room_walk_none.csv")
    truth = data[data["label"] == "ground truth"]
    for label in ("orbslam2", "edgeslam:static"):
        own = data[data["label"] == label]
        near = np.searchsorted(truth["stamp_s"], own["stamp_s"]).clip(0, len(truth) - 1)
        off = own[["x_m", "y_m", "z_m"]].to_numpy() - truth[["x_m", "y_m", "z_m"]].to_numpy()[near]
        assert np.median(np.linalg.norm(off, axis=1)) < 0.05


def test_summary_csv_is_the_contract(reported: Path) -> None:
    table = pd.read_csv(reported / "summary.csv")
    assert tuple(table.columns) == (*SUMMARY_KEYS, "label", "host", "params.n_orb")
    assert len(table) == 12
    first = json.loads((reported / "runs" / f"{0:016x}" / "summary.json").read_text())
    rows = table[(table["cell"] == first["cell"]) & (table["repetition"] == 0)]
    assert rows["ate_rmse_m"].iloc[0] == pytest.approx(first["ate_rmse_m"])


def test_tables_in_four_spellings(reported: Path) -> None:
    results = load(reported)
    metrics = metrics_to_show(results)
    table = cell_tables(cells_of(results, metrics), metrics)[0]
    assert table.headings[:3] == ["system", "link", "runs"]
    assert len(table.csv().splitlines()) == 5
    assert table.markdown().splitlines()[1].startswith("| --- | --- | ---: |")
    latex = table.latex()
    assert r"\toprule" in latex
    assert r"ramp\_85" in latex
    assert r"[\%]" in latex
    console = Console(width=160, record=True)
    console.print(table.rich())
    assert "ATE RMSE [cm]" in console.export_text()


def test_a_table_of_many_columns_breaks_its_numbers_to_fit_on_the_page(reported: Path) -> None:
    """At a width of 1300 pixels, the last columns of update rounds were once cut off."""
    page = (reported / "report" / "index.html").read_text()
    tables = re.findall(r"<table[^>]*>(.*?)</table>", page, re.DOTALL)
    (rounds,) = [body for body in tables if "Parts of a map update round" in body]
    cells = rounds.partition("<tbody>")[2]
    assert " ±\u00a0" in cells and " ± " not in cells
    assert "nowrap" not in re.sub(r"nav a {[^}]*}", "", page)


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("48.2 (47.9 to 48.4)", ["48.2", "(47.9 to 48.4)"]),
        ("100 [44, 100]", ["100", "[44, 100]"]),
        ("48.16 ± 0.25 (n 3)", ["48.16", "± 0.25", "(n 3)"]),
        ("67.61 s", ["67.61 s"]),
        ("too few runs to show any", ["too", "few", "runs", "to", "show", "any"]),
        ("multithread_rl:relocate", ["multithread_rl:", "relocate"]),
        ("synthetic_pioneer360", ["synthetic_", "pioneer360"]),
        ("a_b <c>", ["a_b", "&lt;c&gt;"]),
    ],
)
def test_a_cell_breaks_where_it_may(text: str, lines: list[str]) -> None:
    found = re.split(r" |<wbr>", str(cell(text)))
    assert [line.replace("\u00a0", " ") for line in found] == lines


def test_latex_special_letters_are_escaped() -> None:
    table = Table("t", "c", [r"a\b", "50%"], [["x_y & z", "{#}"], ["T_M->E", "<|"]], words=1)
    assert r"a\textbackslash{}b & 50\%" in table.latex()
    assert r"x\_y \& z & \{\#\}" in table.latex()
    assert r"T\_M-\textgreater{}E & \textless{}\textbar{}" in table.latex()


def test_differences_name_the_better_system(reported: Path, tmp_path: Path) -> None:
    more = quickstart_like(tmp_path, 8, 8.0)
    found = {(d.metric.key, d.under): d for d in differences(load(more), baseline="orbslam2")}
    cpu = found["mobile_cpu_percent_mean", "none"]
    assert (cpu.baseline, cpu.other, cpu.verdict) == ("orbslam2", "edgeslam:static", "better")
    assert "large" in cpu.found.effect
    assert cpu.found.change.low <= cpu.found.change.value <= cpu.found.change.high < 0
    assert found["track_ms_median", "none"].verdict == "no difference shown"


def test_links_are_compared_too(tmp_path: Path) -> None:
    more = quickstart_like(tmp_path, 8, 8.0)
    results = load(more)
    found = differences(results, between="profile")
    assert {(d.under, d.baseline, d.other) for d in found} == {
        ("orbslam2", "none", "ramp_85"), ("edgeslam:static", "none", "ramp_85"),
    }  # fmt: skip
    by_system, by_link = difference_tables(results)
    assert (by_system.name, by_link.name) == ("differences", "differences_links")
    assert len(by_link.rows) == len(found) and by_link.headings[1] == "system"
    assert "[" in by_link.rows[0][7]
    write_report(more, figures=False)
    page = (more / "report" / "index.html").read_text()
    assert "Differences between links" in page and "Differences between systems" in page


def test_a_campaign_reads_its_runs_once_for_page_and_terminal(
    experiment: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def once_more(folder: Path) -> None:
        raise AssertionError(f"{folder} is read once more")

    for module in ("recompute", "experiment"):
        monkeypatch.setattr(f"slambed.report.{module}.load", once_more)
    monkeypatch.setattr("slambed.report.experiment.draw_all", lambda *_: plots.Drawn([], 0))
    console = Console(width=220, record=True)
    show_report(experiment, console)
    assert (experiment / "report.md").is_file()
    assert "12 runs in 4 combinations, 12 valid." in console.export_text()


def test_terminal_summary_has_tables_and_the_way_to_the_page(reported: Path) -> None:
    console = Console(width=220, record=True)
    terminal_summary(reported, console)
    text = console.export_text()
    assert "12 runs in 4 combinations, 12 valid." in text
    assert "mobile CPU [% of a core]" in text
    assert "report/index.html" in text.replace("\n", "")


def test_torn_missing_and_foreign_files_are_reported(experiment: Path) -> None:
    runs = experiment / "runs"
    keys = sorted(path.name for path in runs.iterdir())
    (runs / keys[0] / "summary.json").write_text('{"cell": "x", "valid"')
    (runs / keys[1] / "summary.json").unlink()
    (runs / keys[2] / "events.parquet").write_bytes(b"PAR1 torn")
    (runs / keys[3] / "samples.parquet").unlink()
    (runs / keys[4] / "trajectory.txt").write_text("1 2 3 nonsense\n")
    (runs / keys[5] / "manifest.json").write_text("[]")
    (runs / keys[6] / "link.parquet").write_bytes(b"")
    (runs / "notes.txt").write_text("hello")
    (runs / "stranger").mkdir()
    (runs / "stranger" / "summary.json").write_text('{"cell": ["nested"], "hello": 1}')
    results = load(experiment)
    assert results.table(keys[2], "events") is None
    assert results.table(keys[3], "samples") is None
    assert results.table(keys[6], "link") is None
    assert results.trajectory(keys[4]) is None
    paths = write_report(experiment, figures=False)
    message = "\n".join([*paths.problems, *results.problems])
    for piece in (
        f"{keys[0]}: summary.json is incomplete or not from slambed", f"{keys[1]}: no summary.json",
        "notes.txt: not a run folder", "stranger: summary.json is incomplete or not from slambed",
        f"{keys[5]}: no readable manifest.json", f"{keys[2]}/events.parquet: unreadable",
    ):  # fmt: skip
        assert piece in message
    page = (experiment / "report" / "index.html").read_text()
    assert "summary.json is incomplete or not from slambed" in page
    assert len(pd.read_csv(experiment / "summary.csv")) == 10
    assert "incomplete or not from slambed" in (experiment / "report.md").read_text()


def test_values_of_wrong_type_do_not_stop_a_report(experiment: Path) -> None:
    key = sorted(path.name for path in (experiment / "runs").iterdir())[0]
    path = experiment / "runs" / key / "summary.json"
    summary = json.loads(path.read_text())
    path.write_text(json.dumps(summary | {"ate_rmse_m": "good", "coverage": [1], "odd": 1}))
    paths = write_report(experiment, figures=False)
    assert any("unknown keys in summary.json: odd" in line for line in paths.problems)
    assert any("ate_rmse_m" in line for line in paths.problems)


def test_a_loss_in_a_stalled_run_is_reported(experiment: Path) -> None:
    runs = load(experiment).runs
    lost = runs[runs["lost"].eq(True)].iloc[0]
    file = experiment / "runs" / lost["run_key"] / "summary.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"host_stall_ms_max": 250.0}))
    messages = [line for line in load(experiment).problems if "held up by the host" in line]
    assert len(messages) == 1
    assert messages[0].startswith(f"{lost['cell']}: 1 of the runs")
    assert "for more than 100 ms, at most 250 ms at once" in messages[0]


def test_nodes_that_waited_for_a_processor_are_reported(experiment: Path) -> None:
    """The line has how much each node waited in the run that waited most, and the limit."""
    runs = load(experiment).runs
    run = runs[runs["device_edge"].notna()].iloc[0]
    file = experiment / "runs" / run["run_key"] / "summary.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"cpu_wait_share": 0.84}))
    path = experiment / "runs" / run["run_key"] / "samples.parquet"
    samples = pd.read_parquet(path)
    ways = {"mobile": 3.0, "edge": 0.5}
    waits = samples["node"].map(ways) * samples["cpu_s"] + samples["throttled_s"]
    samples.assign(run_delay_s=waits).to_parquet(path)
    (known,) = [line for line in load(experiment).problems if "waited for a processor" in line]
    runs_of_cell = int(runs["cell"].eq(run["cell"]).sum())
    assert known.startswith(f"{run['cell']}: in 1 of {runs_of_cell} runs the mobile node waited")
    assert "for more than 50 % of the time in which it wanted one: the host was busy" in known
    assert "or the node's own threads waited for each other under its limits; most" in known
    found = re.search(
        rf"most in {run['run_key']}: mobile node 84 % \((\d+) ms .*\), edge node 33 % \((\d+) ms",
        known,
    )
    assert found is not None and int(found[1]) > int(found[2]) > 0
    path.unlink()
    (known,) = [line for line in load(experiment).problems if "waited for a processor" in line]
    assert "mobile node 84 %;" in known and "edge node" not in known


def test_missing_runs_of_the_plan_are_reported(experiment: Path) -> None:
    planned = [{"run_key": "feedface", "cell": "edgeslam:static/room_walk/none", "label": "e"}]
    content = {"experiment": {"title": "Planned", "report": {"metrics": ["keyframes"]}}}
    (experiment / "experiment.json").write_text(json.dumps(content | {"runs": planned}))
    results = load(experiment)
    assert results.title == "Planned"
    assert "edgeslam:static/room_walk/none: 1 runs missing" in results.problems
    assert metrics_to_show(results)[0].heading == "keyframes in the map"


def test_a_report_says_once_what_is_used_instead_of_what(experiment: Path) -> None:
    content = {"experiment": {"title": "Kitchen"}, "stand_ins": {"a_room": "redkitchen"}}
    line = "a_room is played instead of redkitchen: numbers of the two cannot be compared"
    (experiment / "experiment.json").write_text(json.dumps(content))
    assert load(experiment).stand_ins == [line]  # results of before do not name the dataset
    content["datasets"] = {"quickstart": "a_room", "hall": "hall"}
    (experiment / "experiment.json").write_text(json.dumps(content))
    results = load(experiment)
    assert results.title == "Kitchen" and results.stand_ins == [f"dataset quickstart: {line}"]
    paths = write_report(experiment, figures=False)
    for file in (paths.html, paths.markdown):
        assert file.read_text().count(f"dataset quickstart: {line}") == 1
    shown = {said: StringIO() for said in (False, True)}
    for said, out in shown.items():
        terminal_summary(experiment, Console(file=out, width=300), said=said)
    assert shown[False].getvalue().count(line) == 1 and line not in shown[True].getvalue()


def test_the_summary_reports_engine_and_devices(reported: Path) -> None:
    for text in (
        (reported / "report" / "index.html").read_text(),
        (reported / "report.md").read_text(),
    ):
        assert "Engine local: processes under the limits of their device, in real time." in text
        assert "Devices: mobile half_core; edge host." in text
        assert "simulated" not in text


def test_the_plots_that_are_asked_for_come_first(experiment: Path) -> None:
    content = {"experiment": {"title": "T", "report": {"plots": ["trajectory", "keyframes"]}}}
    (experiment / "experiment.json").write_text(json.dumps(content))
    results = load(experiment)
    writer = plots.FigureWriter(experiment, "", [])
    jobs = [job.kind for job in plots.jobs_of(results, [], writer)]
    conditions = jobs.count("trajectory")
    assert conditions and jobs[: conditions + 1] == ["trajectory"] * conditions + ["keyframes"]
    assert {*jobs} <= {*FIGURES, *keys_for(Use.DRAWN), "keyframes"}


def test_the_reference_names_every_figure() -> None:
    page = (repository_root() / "docs" / "reference" / "experiment.md").read_text()
    (row,) = (line for line in page.splitlines() if "| `plots` |" in line)
    assert [name for name in FIGURES if f"`{name}`" not in row] == []


def test_timeline_shows_the_loss(reported: Path) -> None:
    results = load(reported)
    lost = results.runs[results.runs["lost"].eq(True)]["run_key"].iloc[0]
    svg = timeline_svg(results, lost)
    assert svg is not None
    assert "<title>lost from 6." in svg
    assert svg.count("<polyline") == 2


def test_view_draws_a_run_and_says_when_rerun_is_missing(reported: Path, tmp_path: Path) -> None:
    view = view_of(find_run("0000000000000002", reported.parent))
    assert view.alignment is not None
    png = write_png(view, tmp_path)
    assert png.stat().st_size > 10_000
    name = f"{view.row['cell']} #1"
    assert f"<!-- {name} -->" in png.with_suffix(".svg").read_text()
    page = (reported / "report" / "index.html").read_text().replace("<wbr>", "")
    assert f">{name}</td>" in page and "#3</td>" in page and "#0<" not in page
    assert f"<h3>{name}</h3>" in page and "repetition 0" not in page
    try:
        import rerun  # noqa: F401
    except ImportError:
        with pytest.raises(SlambedError, match="rerun-sdk"):
            write_rerun(view, tmp_path / "x.rrd")
    else:
        assert write_rerun(view, tmp_path / "x.rrd").stat().st_size > 10_000
    with pytest.raises(SlambedError, match="is not clear"):
        find_run("0000", reported.parent)
    with pytest.raises(SlambedError, match="no run"):
        find_run("ffff", reported.parent)


def test_commands(reported: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(reported, tmp_path / "results" / "invented")
    options = ["--results", str(tmp_path / "results")]
    monkeypatch.chdir(tmp_path)
    code, out, err = slambed("report", "invented", "--no-figures", *options)
    assert code == 0, err
    code, every, err = slambed("report", "--no-figures", *options)
    assert code == 0 and "invented" in every, err
    code, out, err = slambed("papers", "compare", "dynnetslam", *options)
    assert code == 0 and "not run" in out, err
    assert (tmp_path / "results" / "papers" / "dynnetslam" / "index.html").exists()
    drawn = ("explain", "0000000000000003", "--path", *options)
    code, out, err = slambed(*drawn, "--out", str(tmp_path / "mine"))
    assert code == 0 and Path(out.strip()).parent == tmp_path / "mine", err
    # Without --out, files go to the run's own folder, and none to the current directory.
    code, out, err = slambed(*drawn)
    run = tmp_path / "results" / "invented" / "runs" / "0000000000000003"
    assert Path(out.strip()).parent == run / "pictures", err
    assert not (tmp_path / "pictures").exists()
    taken = tmp_path / "taken"
    taken.write_text("")
    assert "choose another --out" in refused(2, *drawn, "--out", str(taken))
    truth = tmp_path / "results" / "invented" / "groundtruth" / "room_walk.txt"
    _, out, _ = slambed("evaluate", str(run / "trajectory.txt"), str(truth))
    assert "ATE RMSE 0.01" in out
    assert "no results in" in refused(2, "report", "nowhere", *options)


def test_tables_of_an_earlier_report_are_removed_and_other_files_kept(tmp_path: Path) -> None:
    first, second = Table("cells_1", "One", ["a"]), Table("cells_2", "Two", ["a"])
    first.rows, second.rows = [["1"]], [["2"]]
    write_tables([first, second], tmp_path)
    (tmp_path / "mine.csv").write_text("a\n")
    second.rows = []
    write_tables([first, second], tmp_path)
    visible = sorted(path.name for path in tmp_path.iterdir() if path.name[0] != ".")
    assert visible == ["cells_1.csv", "cells_1.md", "cells_1.tex", "mine.csv"]
