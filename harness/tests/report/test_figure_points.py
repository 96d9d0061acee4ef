# SPDX-License-Identifier: Apache-2.0
"""Points for the pointer are at their place in the figure, and agree with its data."""

import json
import re
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from results_factory import quickstart_like

from slambed.report.experiment import write_report
from slambed.report.figure_points import points_of
from slambed.report.page import page_script
from slambed.report.style import FigureWriter, figure


def shares(axes: dict, x: float, y: float) -> tuple[float, float]:
    """Places a point like the page's script (view_math.js, figures.js)."""

    def place(value: float, scale: dict) -> float:
        f = np.log10 if scale["scale"] == "log" else float
        begin, end = scale["limits"]
        return (f(value) - f(begin)) / (f(end) - f(begin))

    x0, y0, x1, y1 = axes["box"]
    return x0 + (x1 - x0) * place(x, axes["x"]), y1 - (y1 - y0) * place(y, axes["y"])


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_points_are_where_they_are_drawn(scale: str) -> None:
    with figure(2, 1) as (made, axes):
        axes[1].plot([1.0, 3.0, 7.0], [10.0, 100.0, 20.0], label="mine", color="#D55E00")
        axes[1].set_yscale(scale)
        axes[1].set_xlabel("time [s]")
        made.canvas.draw()
        found = points_of(made)["axes"][1]
        (curve,) = found["curves"]
        width, height = made.canvas.get_width_height()
        for x, y in ((1.0, 10.0), (3.0, 100.0), (7.0, 20.0)):
            px, py = axes[1].transData.transform((x, y))
            assert shares(found, x, y) == pytest.approx((px / width, 1 - py / height), abs=1e-3)
    assert (curve["name"], curve["color"], curve["x"]) == ("mine", "#d55e00", [1.0, 3.0, 7.0])
    assert (found["x"]["label"], found["y"]["scale"], found["x"]["names"]) == (
        "time [s]",
        scale,
        [],
    )


def test_names_of_cells_stand_at_their_places_and_numbers_are_none() -> None:
    with figure() as (made, axes):
        axes[0].barh([0, 1], [3.0, -2.0], label="part")
        axes[0].set_yticks([0, 1], ["alone\nroom", "edge"])
        made.canvas.draw()
        (found,) = points_of(made)["axes"]
    assert found["y"]["names"] == [[0.0, "alone room"], [1.0, "edge"]]
    assert found["x"]["names"] == []
    assert [(bar["name"], bar["value"]) for bar in found["bars"]] == [("part", 3.0), ("part", -2.0)]


def test_what_is_no_data_cannot_be_pointed_at() -> None:
    with figure() as (made, axes):
        axes[0].axvline(3.0)
        axes[0].plot([0.0, np.nan, 9.0, 1000.0], [0.0, 1.0, 2.0, 3.0])
        axes[0].set_xlim(0, 10)
        made.canvas.draw()
        (curve,) = points_of(made)["axes"][0]["curves"]
    assert (curve["x"], curve["name"]) == ([0.0, 9.0], "")


def test_a_long_curve_is_thinned() -> None:
    with figure() as (made, axes):
        axes[0].plot(np.arange(50_000.0), np.arange(50_000.0))
        made.canvas.draw()
        (curve,) = points_of(made)["axes"][0]["curves"]
    assert len(curve["x"]) == 1000 and curve["x"][-1] == 49999


def test_points_go_with_their_figure(tmp_path: Path) -> None:
    writer = FigureWriter(tmp_path, "test", [], formats=("svg",))
    with figure() as (made, axes):
        axes[0].plot([0, 1], [0, 1])
        writer.save(made, "box", "Box", "", pd.DataFrame({"x": [0, 1]}))
    (saved,) = writer.saved
    assert "box.points.json" in saved.files and writer.has(saved)
    (tmp_path / "box.points.json").unlink()
    assert not writer.has(saved)
    writer.nothing("box", "Box", "no run")
    assert list(tmp_path.iterdir()) == []


def test_a_report_is_one_file_with_script_and_points(tmp_path: Path) -> None:
    experiment = quickstart_like(tmp_path, repetitions=2)
    page = write_report(experiment, formats=("png", "svg")).html.read_text()
    assert page.count("<script>") == 1 and f"<script>{page_script()}</script>" in page
    assert not re.search(r'<(?:script|link|img|iframe)[^>]*(?:src|href)="(?!data:)', page)
    blocks = re.findall(r'<script type="application/json" class="points">(.*?)</script>', page)
    figures = json.loads((experiment / "report" / "figures.json").read_text())
    assert len(blocks) == len(figures) > 5
    for item, block in zip(figures, blocks, strict=True):
        kept = json.loads((experiment / "report" / f"{item['name']}.points.json").read_text())
        assert json.loads(block) == kept
    # All runs of the plotted metric are among the points.
    ate = json.loads((experiment / "report" / "box_ate_rmse_m.points.json").read_text())
    shown = {x for axes in ate["axes"] for curve in axes["curves"] for x in curve["x"]}
    data = pd.read_csv(experiment / "report" / "box_ate_rmse_m.csv")
    for value in 100 * data["ate_rmse_m"]:
        assert any(abs(value - x) < 1e-3 * value for x in shown)


def test_nothing_in_the_points_ends_their_element(tmp_path: Path) -> None:
    from slambed.report.html import _points
    from slambed.report.style import SavedFigure

    (tmp_path / "x.points.json").write_text(json.dumps({"says": "</script><b>"}))
    text = _points(tmp_path, SavedFigure("x", "", "", "", [], ""))
    assert "<" not in text and json.loads(text) == {"says": "</script><b>"}
    plt.close("all")
