# SPDX-License-Identifier: Apache-2.0
"""Figures of reports, drawn from made-up cells."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from matplotlib.figure import Figure
from results_factory import RawRun, spec_of, write_experiment

from slambed.metrics.catalog import metric
from slambed.metrics.statistics import Interval
from slambed.report.cells import Cell, cells_of
from slambed.report.conditions import Condition, conditions_of
from slambed.report.contrast import MetricContrast
from slambed.report.differences import Difference
from slambed.report.experiment import write_report
from slambed.report.figures.boxes import MOST_CELLS, draw_metric
from slambed.report.figures.changes import draw_changes
from slambed.report.figures.losses import draw_losses, draw_losses_by_profile
from slambed.report.figures.stages import STAGES, _stage_bars
from slambed.report.figures.tradeoff import draw_tradeoff
from slambed.report.load import load
from slambed.report.style import COLORS, FigureWriter, lay_out


@pytest.mark.parametrize("lost", [False, True])
def test_without_a_loss_a_line_stands_where_an_empty_figure_was(tmp_path: Path, lost: bool) -> None:
    runs = [
        (
            spec_of("edgeslam", "static", profile, i),
            RawRun(duration_s=4, seed=i, lost_at_s=((2.0, 3.0),) if lost and i else ()),
        )
        for profile in ("none", "ramp_85")
        for i in range(2)
    ]
    results = load(write_experiment(tmp_path, runs))
    writer = FigureWriter(tmp_path / "figures", "", [])
    (*_, condition) = conditions_of(results)
    older = tmp_path / "figures" / f"losses_room_walk_{condition.profile}.svg"
    older.parent.mkdir()
    older.write_text("of an earlier report")
    draw_losses(results, condition, writer)
    draw_losses_by_profile(results, "edgeslam:static", "room_walk", results.valid_runs, writer)
    drawn = {path.name.split("_room")[0] for path in writer.folder.glob("*.svg")}
    assert drawn == ({"losses", "losses_by_profile"} if lost else set())
    assert [line.rpartition(": ")[2] for line in writer.empty] == (
        [] if lost else [f"nothing to draw, no track loss in {count} runs" for count in (2, 4)]
    )


def test_the_page_says_which_figures_had_nothing_to_show(tmp_path: Path) -> None:
    runs = [(spec_of("orbslam2", "default", "none", i), RawRun(4, seed=i)) for i in range(2)]
    folder = write_experiment(tmp_path, runs)
    paths = write_report(folder)
    line = "Track losses over time: room_walk, none: nothing to draw, no track loss in 2 runs."
    assert line in paths.html.read_text() and line in paths.markdown.read_text()
    assert not list(paths.folder.glob("losses*"))


@pytest.mark.parametrize("systems", [1, 3, 8])
def test_names_of_stages_can_be_read_and_do_not_touch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, systems: int
) -> None:
    stages = [*STAGES, *(f"stage_{i}" for i in range(4))]
    table = pd.DataFrame(
        [
            {"label": f"system {i}", "node": node, "stage": stage, "mean_ms": 10.0 + i, "runs": 5}
            for i in range(systems)
            for node in ("mobile", "edge")
            for stage in stages
        ]
    )
    figures: list[Figure] = []
    writer = FigureWriter(tmp_path, "", [])
    monkeypatch.setattr(writer, "save", lambda made, *_: figures.append(made))
    labels = tuple(f"system {i}" for i in range(systems))
    _stage_bars(table, Condition("room", "none", pd.DataFrame(), labels), writer)
    (made,) = figures
    lay_out(made)
    names = made.axes[0].get_yticklabels()
    assert len(names) == 2 * len(stages)
    # A page shows a figure of 5.4 inches at least 448 pixels wide, so text has 12 pixels, as in its
    # tables.
    assert all(name.get_fontsize() * 448 / (72 * made.get_figwidth()) >= 12 for name in names)
    boxes = sorted((name.get_window_extent() for name in names), key=lambda box: box.y0)
    assert all(low.y1 < high.y0 for low, high in pairwise(boxes))
    assert all(box.x0 >= 0 for box in boxes)


@pytest.mark.parametrize("profiles", [1, 5])
def test_a_tradeoff_names_its_points_beside_the_axes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, profiles: int
) -> None:
    figures: list[Figure] = []
    writer = FigureWriter(tmp_path, "", [])
    monkeypatch.setattr(writer, "save", lambda made, *_: figures.append(made))
    cells = [
        Cell(
            f"c{i}{j}",
            f"system_with_a_name_{i}",
            "room",
            f"a_profile_{j}",
            5,
            5,
            "",
            {
                "bytes_up": Interval(1e6 * (i + j), 1e6 * i, 3e6 * (i + j), 5),
                "ate_rmse_m": Interval(0.01 * j, 0.0, 0.02 * (i + j + 1), 5),
            },
            [],
        )
        for i in range(9)
        for j in range(profiles)
    ]
    assert draw_tradeoff(cells, "room", "bytes_up", "ate_rmse_m", writer)
    (made,) = figures
    lay_out(made)
    (axes,), (legend,) = made.axes, made.legends
    assert not axes.texts and axes.get_legend() is None
    beside, page = legend.get_window_extent(), made.bbox
    assert not beside.overlaps(axes.get_tightbbox())
    assert page.x0 <= beside.x0 and beside.x1 <= page.x1 and page.y0 <= beside.y0
    names = [text.get_text() for text in legend.get_texts()]
    shapes = [f"a_profile_{j}" for j in range(profiles)] if profiles > 1 else []
    assert names == [*(f"system_with_a_name_{i}" for i in range(9)), *shapes]
    points = [line for line in axes.lines if line.get_marker() not in ("None", "_", "|")]
    looks = {(p.get_color(), p.get_markerfacecolor(), p.get_marker()) for p in points}
    assert len(looks) == len(cells)


@pytest.mark.parametrize(
    ("ranges", "words"),
    [
        ((False, False), "95 % intervals"),
        ((True, True), "the range of fewer than 6 runs"),
        ((True, False), "95 % intervals, or the range of fewer than 6 runs"),
    ],
)
def test_the_caption_of_a_tradeoff_names_ranges(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ranges: tuple[bool, bool], words: str
) -> None:
    captions: list[str] = []
    data: list[pd.DataFrame] = []
    writer = FigureWriter(tmp_path, "", [])
    monkeypatch.setattr(
        writer, "save", lambda *parts: (captions.append(parts[3]), data.append(parts[4]))
    )
    cells = [
        Cell(
            f"c{i}", "a", "room", "none", 5, 5, "",
            {
                "bytes_up": Interval(1e6 * i, 1e6 * i, 3e6 * i, 5, ranges[0]),
                "ate_rmse_m": Interval(0.01 * i, 0.0, 0.02 * i, 5, ranges[1]),
            },
            [],
        )
        for i in (1, 2, 3)
    ]  # fmt: skip
    assert draw_tradeoff(cells, "room", "bytes_up", "ate_rmse_m", writer)
    assert captions == [f"One point per combination with {words}; lines join those of a system."]
    assert list(data[0].columns) == [
        "cell", "bytes_up", "bytes_up_low", "bytes_up_high",
        "ate_rmse_m", "ate_rmse_m_low", "ate_rmse_m_high",
    ]  # fmt: skip
    # Keys are of stored units, whatever the axes show.
    assert list(data[0].loc[2][["bytes_up", "ate_rmse_m"]]) == pytest.approx([3e6, 0.03])


@pytest.mark.parametrize("count", [1, 4])
def test_a_box_figure_ends_where_its_scale_does_and_names_single_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int
) -> None:
    runs = [(spec_of("orbslam2", "default", "none", i), RawRun(4, seed=i)) for i in range(count)]
    results = load(write_experiment(tmp_path, runs))
    results.runs["coverage"] = 1.0
    writer = FigureWriter(tmp_path, "", [])
    saved: list[tuple[Figure, str]] = []
    monkeypatch.setattr(writer, "save", lambda made, *more: saved.append((made, more[2])))
    draw_metric(results, cells_of(results, [metric("coverage")]), metric("coverage"), writer)
    ((made, caption),) = saved
    (axes,) = made.axes
    assert axes.get_xlim()[0] < 100 == axes.get_xlim()[1]
    assert [text.get_text() for text in axes.texts] == (["100.0"] if count == 1 else [])
    assert ("the only run" in caption, "Box:" in caption) == (count == 1, count > 1)


def test_figures_say_how_many_cells_they_leave_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    results = load(
        write_experiment(tmp_path, [(spec_of("orbslam2", "default", "none", 0), RawRun(2))])
    )
    captions: list[str] = []
    writer = FigureWriter(tmp_path, "", [])
    monkeypatch.setattr(writer, "save", lambda *parts: captions.append(parts[3]))
    for count in (MOST_CELLS, MOST_CELLS + 2):
        cells = [
            Cell(f"c{i}", "a", "room", f"l{i}", 5, 5, "", {"lost": Interval(0.2, 0, 1, 5)}, [])
            for i in range(count)
        ]
        draw_metric(results, cells, metric("lost"), writer)
    assert ["more combinations" in caption for caption in captions] == [False, True]
    assert captions[1].endswith(" 2 more combinations are in summary.csv.")


def test_colors_differ_in_gray_too() -> None:
    gray = [
        sum(int(c[i : i + 2], 16) * w for i, w in ((1, 0.3), (3, 0.6), (5, 0.1)))
        for c in COLORS[:2]
    ]
    assert abs(gray[0] - gray[1]) > 20
    assert len(set(COLORS)) == len(COLORS)


def test_what_each_system_changes_is_drawn_where_an_experiment_asks_for_it(tmp_path: Path) -> None:
    lost = ((2.0, 3.0),)
    runs = [
        (
            spec_of(
                "edgeslam",
                "static",
                profile,
                i,
                engine="virtual",
                label=label,
                cell=f"{label}/room_walk/{profile}",
            ),
            RawRun(
                duration_s=4, seed=i, lost_at_s=lost if label == "original" or i < saved else ()
            ),
        )
        for profile in ("none", "ramp_85")
        for label, saved in (("original", 8), ("binary codec", 6), ("all four", 0))
        for i in range(8)
    ]
    experiment = write_experiment(tmp_path, runs)
    assert not list(write_report(experiment).folder.glob("changes*"))
    asked = {
        "report": {"metrics": ["lost"], "plots": ["changes"]},
        "systems": [{"label": name} for name in ("original", "binary codec", "all four")],
    }
    (experiment / "experiment.json").write_text(json.dumps({"experiment": asked}))
    paths = write_report(experiment)
    data = pd.read_csv(paths.folder / "changes_room_walk_lost.csv")
    assert list(data["system"]) == ["binary codec", "all four"] * 2
    assert set(data["link"]) == {"none", "ramp_85"} and set(data["baseline"]) == {"original"}
    assert list(data["change"]) == pytest.approx([-25, -100] * 2)
    assert (data["low"] <= data["change"]).all() and (data["change"] <= data["high"]).all()
    assert (data["high"][data["system"] == "all four"] < -50).all()
    figures = json.loads((paths.folder / "figures.json").read_text())
    assert figures[0]["name"] == "changes_room_walk_lost"
    assert "pairs of equal seed" in figures[0]["caption"]


def test_infinite_changes_are_drawn_at_the_edge(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = FigureWriter(tmp_path, "", [])
    saved: list[Any] = []
    monkeypatch.setattr(writer, "save", lambda *parts: saved.append(parts))
    inf, item = float("inf"), metric("ate_rmse_m")
    changes = {"b": Interval(0.01, -0.01, 0.02, 9), "c": Interval(inf, 0.0, inf, 9)}
    found = [
        Difference(
            "room", "none", item, "a", other, MetricContrast(0.1, 0.2, change, "", 1, True, 0), 1.0
        )
        for other, change in changes.items()
    ]
    draw_changes(found, "room", writer)
    draw_changes(found[:1], "room", writer)
    (made, *_, caption, data), (_, *_, plain, _) = saved
    assert caption.endswith("A mark at the edge is infinite: runs failed.")
    assert "edge" not in plain and list(data["change"]) == [1.0, inf]
    (axis,) = made.axes
    points = axis.containers[0].lines[0].get_xdata()
    assert list(points) == pytest.approx([1.0, 2.6]) and axis.get_xlim()[1] == pytest.approx(2.6)


def test_with_every_frame_losses_are_over_the_sequence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = [
        (spec_of("edgeslam", "static", profile, i), RawRun(4, seed=i, lost_at_s=((2.0, 3.0),)))
        for profile in ("none", "ramp_85")
        for i in range(2)
    ]
    results = load(write_experiment(tmp_path, runs))
    results.runs["wall_s"] = 40.0  # ten times the sequence
    writer = FigureWriter(tmp_path, "", [])
    made: list[Figure] = []
    monkeypatch.setattr(writer, "save", lambda figure, *_: made.append(figure))
    for mode in ("realtime", "every_frame"):
        results.spec["playback"] = {"mode": mode}
        (*_, condition) = conditions_of(results)
        draw_losses(results, condition, writer)
        draw_losses_by_profile(results, "edgeslam:static", "room_walk", results.valid_runs, writer)
    assert [len(figure.axes) for figure in made] == [2, 1, 1, 1]
    ends = [figure.axes[0].get_xlim()[1] for figure in made]
    assert ends[:2] == [40.0, 40.0] and ends[2:] == pytest.approx([4.0, 4.0], abs=0.1)


def test_a_system_has_one_color_where_another_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lost(system: str, variant: str, profile: str, seed: int) -> tuple[Any, RawRun]:
        run = RawRun(duration_s=4, seed=seed, lost_at_s=((2.0, 3.0),))
        return spec_of(system, variant, profile, seed), run

    runs = [
        lost("orbslam2", "default", "none", 0),
        lost("edgeslam", "static", "none", 0),
        lost("edgeslam", "static", "ramp_85", 0),
    ]
    results = load(write_experiment(tmp_path, runs))
    writer = FigureWriter(tmp_path / "figures", "", [])
    colors: list[str] = []

    def keep(made: Figure, *_: object) -> None:
        colors.extend(
            str(line.get_color())
            for line in made.axes[0].get_lines()
            if str(line.get_label()).startswith("edgeslam")
        )

    monkeypatch.setattr(writer, "save", keep)
    for condition in conditions_of(results):
        draw_losses(results, condition, writer)
    assert len(colors) == 2 and len(set(colors)) == 1
