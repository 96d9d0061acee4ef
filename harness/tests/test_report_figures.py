# SPDX-License-Identifier: Apache-2.0
"""Figures of reports, drawn from invented cells."""

from pathlib import Path

import pytest
from matplotlib.figure import Figure
from results_factory import RawRun, spec_of, write_experiment

from slambed.metrics.catalog import metric
from slambed.metrics.statistics import Interval
from slambed.report.cells import Cell, cells_of
from slambed.report.conditions import conditions_of
from slambed.report.figures.boxes import draw_metric
from slambed.report.figures.losses import draw_losses, draw_losses_by_profile
from slambed.report.figures.tradeoff import draw_tradeoff
from slambed.report.load import load
from slambed.report.style import COLOURS, FigureWriter


@pytest.mark.parametrize("lost", [False, True])
def test_losses_figure_without_a_loss_says_so(tmp_path: Path, lost: bool) -> None:
    runs = [
        (spec_of("edgeslam", "static", profile, i),
         RawRun(duration_s=4, seed=i, lost_at_s=((2.0, 3.0),) if lost and i else ()))
        for profile in ("none", "ramp_85")
        for i in range(2)
    ]  # fmt: skip
    results = load(write_experiment(tmp_path, runs))
    writer = FigureWriter(tmp_path / "figures", "", [])
    (*_, condition) = conditions_of(results)
    draw_losses(results, condition, writer)
    draw_losses_by_profile(results, "edgeslam:static", "room_walk", results.trusted, writer)
    for name, count in (("losses_room_walk", 2), ("losses_by_profile_room_walk", 4)):
        (svg,) = writer.folder.glob(f"{name}_[er]*.svg")
        assert (f"<!-- no track loss in {count} runs -->" in svg.read_text()) is not lost


@pytest.mark.parametrize("profiles", [1, 5])
def test_a_tradeoff_names_its_points_beside_the_axes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, profiles: int
) -> None:
    figures: list[Figure] = []
    writer = FigureWriter(tmp_path, "", [])
    monkeypatch.setattr(writer, "save", lambda made, *_: figures.append(made))
    cells = [
        Cell(f"c{i}{j}", f"system_with_a_name_{i}", "room", f"a_profile_{j}", 5, 5, "",
             {"bytes_up": Interval(1e6 * (i + j), 1e6 * i, 3e6 * (i + j), 5),
              "ate_rmse_m": Interval(0.01 * j, 0.0, 0.02 * (i + j + 1), 5)}, [])
        for i in range(9)
        for j in range(profiles)
    ]  # fmt: skip
    assert draw_tradeoff(cells, "room", "bytes_up", "ate_rmse_m", writer)
    (made,) = figures
    made.draw_without_rendering()
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


def test_colours_differ_in_grey_too() -> None:
    grey = [sum(int(c[i : i + 2], 16) * w for i, w in ((1, 0.3), (3, 0.6), (5, 0.1)))
            for c in COLOURS[:2]]  # fmt: skip
    assert abs(grey[0] - grey[1]) > 20
    assert len(set(COLOURS)) == len(COLOURS)
