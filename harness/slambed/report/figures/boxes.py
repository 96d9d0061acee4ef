# SPDX-License-Identifier: Apache-2.0
"""Draws one metric over all cells: boxes with runs as points, or shares with Wilson intervals."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from slambed.metrics.metric import Metric
from slambed.metrics.statistics import Floats, finite, wilson
from slambed.report.cells import Cell
from slambed.report.load import Results
from slambed.report.style import (
    NOTE_PT,
    FigureWriter,
    color,
    figure,
    file_name,
    from_zero_if_it_shows,
    marker,
)

MOST_CELLS = 40
MOST_POINTS = 60


def draw_metric(results: Results, cells: list[Cell], metric: Metric, writer: FigureWriter) -> None:
    """Draws the cells from top to bottom; color and marker show the system."""
    if metric.kind == "share":
        _draw_shares(results, cells, metric, writer)
        return
    shown = [cell for cell in cells if metric.key in cell.values][:MOST_CELLS]
    if not shown:
        return
    labels = list(dict.fromkeys(cell.label for cell in cells))
    groups = {name: rows for name, rows in results.valid_runs.groupby("cell", sort=False)}
    rng = np.random.default_rng(1)
    rows: list[pd.DataFrame] = []
    drawn: list[Floats] = []
    with figure(height_in=_height(len(shown))) as (made, axes):
        axis = axes[0]
        for place, cell in enumerate(shown):
            runs = groups[cell.name]
            values = finite(runs[metric.key].to_numpy()) * metric.scale
            index = labels.index(cell.label)
            if len(values) == 1:
                _draw_one(axis, place, values[0], metric, index)
            else:
                _draw_box(axis, place, values, index, rng)
            drawn.append(values)
            rows.append(runs[["cell", "run_key", metric.key]])
        where = _finish_cells(axis, shown)
        axis.set_xlabel(metric.heading)
        everything = np.concatenate(drawn)
        # A cost that looks half as long must be half as large.
        from_zero = metric.better != "lower" or from_zero_if_it_shows(axis, everything)
        axis.margins(x=0.06)
        if axis.get_xlim()[1] > metric.largest_shown:
            axis.set_xlim(right=metric.largest_shown)
        axis.set_title(metric.title + where)
        left_out = len([c for c in cells if metric.key in c.values]) - len(shown)
        writer.save(
            made,
            file_name("box", metric.key),
            metric.title + where,
            _caption({len(values) for values in drawn}, from_zero, left_out),
            pd.concat(rows, ignore_index=True),
        )


def _caption(counts: set[int], from_zero: bool, left_out: int) -> str:
    """Returns what the marks mean; `counts` has the numbers of runs of the cells."""
    parts = {
        "Box: quartiles and median; whiskers: smallest and largest run; points: runs.": (
            max(counts) > 1
        ),
        "A mark with its value: the only run of its combination.": 1 in counts,
        "The axis does not begin at 0.": not from_zero,
        f"{left_out} more combinations are in summary.csv.": left_out > 0,
    }
    return " ".join(part for part, holds in parts.items() if holds)


def _draw_box(axis: Axes, place: int, values: Floats, index: int, rng: np.random.Generator) -> None:
    axis.boxplot(
        values,
        positions=[place],
        orientation="horizontal",
        widths=0.55,
        whis=(0, 100),
        patch_artist=True,
        showfliers=False,
        manage_ticks=False,
        boxprops={"facecolor": color(index), "alpha": 0.25, "linewidth": 0.8},
        medianprops={"color": color(index), "linewidth": 1.8},
        whiskerprops={"linewidth": 0.8},
        capprops={"linewidth": 0.8},
    )
    points = values if len(values) <= MOST_POINTS else rng.choice(values, MOST_POINTS, False)
    axis.plot(
        points,
        place + rng.uniform(-0.16, 0.16, len(points)),
        marker(index),
        color=color(index),
        markersize=3.5,
        alpha=0.8 if len(values) <= 20 else 0.3,
        zorder=1.5,
        linestyle="none",
        clip_on=False,
    )


def _draw_one(axis: Axes, place: int, value: float, metric: Metric, index: int) -> None:
    """Draws a single run, which has no quartiles, as a mark with its number."""
    axis.plot(value, place, marker(index), color=color(index), markersize=6, clip_on=False)
    axis.annotate(
        metric.show(value / metric.scale),
        (value, place),
        xytext=(0, 5),
        textcoords="offset points",
        ha="center",
        va="bottom",
        fontsize=NOTE_PT,
    )


def _draw_shares(results: Results, cells: list[Cell], metric: Metric, writer: FigureWriter) -> None:
    shown = [cell for cell in cells if metric.key in cell.values][:MOST_CELLS]
    if not shown:
        return
    labels = list(dict.fromkeys(cell.label for cell in cells))
    rows: list[dict[str, object]] = []
    with figure(height_in=_height(len(shown))) as (made, axes):
        axis = axes[0]
        for place, cell in enumerate(shown):
            share = cell.values[metric.key]
            index = labels.index(cell.label)
            found = wilson(round(share.value * share.count), share.count)
            axis.barh(place, 100 * found.value, color=color(index), alpha=0.35, height=0.55)
            axis.plot([100 * found.low, 100 * found.high], [place, place], color=color(index))
            axis.plot(100 * found.value, place, marker(index), color=color(index))
            axis.annotate(
                f"{round(share.value * share.count)}/{share.count}",
                (100 * found.high, place),
                xytext=(4, 0),
                textcoords="offset points",
                va="center",
                fontsize=NOTE_PT,
            )
            rows.append(
                {
                    "cell": cell.name,
                    "share": found.value,
                    "low": found.low,
                    "high": found.high,
                    "runs": found.count,
                }
            )
        where = _finish_cells(axis, shown)
        axis.set_xlim(-2, 108)
        axis.set_xlabel(metric.heading)
        axis.set_title(metric.title + where)
        left_out = len([c for c in cells if metric.key in c.values]) - len(shown)
        more = f" {left_out} more combinations are in summary.csv." if left_out else ""
        writer.save(
            made,
            file_name("share", metric.key),
            metric.title + where,
            "Share of the valid runs with its 95 % Wilson interval." + more,
            pd.DataFrame(rows),
        )


def _height(cells: int) -> float:
    return 1.2 + 0.34 * cells


def _finish_cells(axis: Axes, shown: list[Cell]) -> str:
    """Names the cells; returns what all of them share, for the title."""
    places = {(cell.dataset, cell.profile) for cell in shown}
    one = len(places) == 1 and len({cell.label for cell in shown}) == len(shown)
    axis.set_yticks(range(len(shown)), [cell.label if one else short(cell) for cell in shown])
    axis.set_ylim(len(shown) - 0.4, -0.6)
    axis.grid(axis="y", visible=False)
    return f": {', '.join(places.pop())}" if one else ""


def short(cell: Cell) -> str:
    """Returns a cell name, on two lines if it is long."""
    where = f"{cell.dataset}, {cell.profile}"
    return (
        f"{cell.label}\n{where}" if len(cell.label) + len(where) > 24 else f"{cell.label}, {where}"
    )
