# SPDX-License-Identifier: Apache-2.0
"""One metric over all cells: boxes with every run as a point, or shares with Wilson intervals."""

import numpy as np
import pandas as pd

from slambed.metrics.statistics import finite, wilson
from slambed.report.catalog import Metric
from slambed.report.cells import Cell
from slambed.report.load import Results
from slambed.report.style import FigureWriter, colour, figure, file_name, marker

MOST_CELLS = 40
MOST_POINTS = 60


def draw_metric(results: Results, cells: list[Cell], metric: Metric, writer: FigureWriter) -> None:
    """Cells from top to bottom; colour and marker tell the system."""
    if metric.kind == "share":
        _draw_shares(results, cells, metric, writer)
        return
    shown = [cell for cell in cells if metric.key in cell.values][:MOST_CELLS]
    if not shown:
        return
    labels = list(dict.fromkeys(cell.label for cell in cells))
    groups = {name: rows for name, rows in results.valid.groupby("cell", sort=False)}
    rng = np.random.default_rng(1)
    rows: list[pd.DataFrame] = []
    with figure(height_in=_height(len(shown))) as (made, axes):
        axis = axes[0]
        for place, cell in enumerate(shown):
            runs = groups[cell.name]
            values = finite(runs[metric.key].to_numpy()) * metric.scale
            index = labels.index(cell.label)
            axis.boxplot(
                values, positions=[place], orientation="horizontal", widths=0.55, whis=(0, 100),
                patch_artist=True, showfliers=False, manage_ticks=False,
                boxprops={"facecolor": colour(index), "alpha": 0.25, "linewidth": 0.8},
                medianprops={"color": colour(index), "linewidth": 1.8},
                whiskerprops={"linewidth": 0.8}, capprops={"linewidth": 0.8},
            )  # fmt: skip
            points = (
                values if len(values) <= MOST_POINTS else rng.choice(values, MOST_POINTS, False)
            )
            axis.plot(
                points, place + rng.uniform(-0.16, 0.16, len(points)), marker(index),
                color=colour(index), markersize=3.5, alpha=0.8 if len(values) <= 20 else 0.3,
                zorder=1.5, linestyle="none",
            )  # fmt: skip
            rows.append(runs[["cell", "run_key", metric.key]])
        _finish_cells(axis, shown)
        axis.set_xlabel(metric.heading)
        if metric.better == "lower":
            axis.set_xlim(left=0)  # a cost that looks half as long shall be half as large
        axis.set_title(metric.label[0].upper() + metric.label[1:])
        left_out = len([c for c in cells if metric.key in c.values]) - len(shown)
        writer.save(
            made,
            file_name("box", metric.key),
            metric.label[0].upper() + metric.label[1:],
            "Box: quartiles and median; whiskers: smallest and largest run; points: runs."
            + (f" {left_out} more cells are in summary.csv." if left_out else ""),
            pd.concat(rows, ignore_index=True),
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
            axis.barh(place, 100 * found.value, color=colour(index), alpha=0.35, height=0.55)
            axis.plot([100 * found.low, 100 * found.high], [place, place], color=colour(index))
            axis.plot(100 * found.value, place, marker(index), color=colour(index))
            axis.annotate(
                f"{round(share.value * share.count)}/{share.count}", (100 * found.high, place),
                xytext=(4, 0), textcoords="offset points", va="center", fontsize=7,
            )  # fmt: skip
            rows.append(
                {"cell": cell.name, "share": found.value, "low": found.low, "high": found.high,
                 "runs": found.count}
            )  # fmt: skip
        _finish_cells(axis, shown)
        axis.set_xlim(0, 108)
        axis.set_xlabel(metric.heading)
        axis.set_title(metric.label[0].upper() + metric.label[1:])
        writer.save(
            made,
            file_name("share", metric.key),
            metric.label[0].upper() + metric.label[1:],
            "Share of valid runs with its 95 % Wilson interval.",
            pd.DataFrame(rows),
        )


def _height(cells: int) -> float:
    return 1.2 + 0.34 * cells


def _finish_cells(axis: object, shown: list[Cell]) -> None:
    from matplotlib.axes import Axes

    assert isinstance(axis, Axes)
    axis.set_yticks(range(len(shown)), [short(cell) for cell in shown])
    axis.set_ylim(len(shown) - 0.4, -0.6)
    axis.grid(axis="y", visible=False)


def short(cell: Cell) -> str:
    """A cell name on two lines when it is long."""
    where = f"{cell.dataset}, {cell.profile}"
    return (
        f"{cell.label}\n{where}" if len(cell.label) + len(where) > 24 else f"{cell.label}, {where}"
    )
