# SPDX-License-Identifier: Apache-2.0
"""Trade-off curves: what a cell costs against what it achieves, joined by system."""

import pandas as pd

from slambed.report.catalog import metric
from slambed.report.cells import Cell
from slambed.report.style import FigureWriter, colour, dash, figure, file_name, marker

PAIRS = (
    ("mobile_cpu_percent_mean", "ate_rmse_m"),
    ("mobile_cpu_percent_mean", "lost"),
    ("bytes_up", "ate_rmse_m"),
    ("rtt_asked_ms_mean", "lost"),
    ("rtt_asked_ms_mean", "update_delay_ms_median"),
)

MINIMUM_PLACES = 3
"""Two points are a comparison, not a curve."""


def draw_tradeoff(cells: list[Cell], dataset: str, x: str, y: str, writer: FigureWriter) -> bool:
    """Medians (shares) with intervals; False when too few cells differ along the x axis."""
    shown = [c for c in cells if c.dataset == dataset and x in c.values and y in c.values]
    if len({f"{c.values[x].value:.2g}" for c in shown}) < MINIMUM_PLACES:
        return False
    across, up = metric(x), metric(y)
    labels = list(dict.fromkeys(cell.label for cell in cells))
    rows: list[dict[str, object]] = []
    with figure(height_in=3.6) as (made, axes):
        axis = axes[0]
        for label in dict.fromkeys(cell.label for cell in shown):
            index = labels.index(label)
            own = sorted((c for c in shown if c.label == label), key=lambda c: c.values[x].value)
            xs = [cell.values[x].scaled(across.scale) for cell in own]
            ys = [cell.values[y].scaled(up.scale) for cell in own]
            axis.errorbar(
                [v.value for v in xs], [v.value for v in ys],
                xerr=[[v.value - v.low for v in xs], [v.high - v.value for v in xs]],
                yerr=[[v.value - v.low for v in ys], [v.high - v.value for v in ys]],
                color=colour(index), marker=marker(index), linestyle=dash(index),
                elinewidth=0.8, capsize=2, linewidth=0.9, label=label,
            )  # fmt: skip
            for cell, a, b in zip(own, xs, ys, strict=True):
                axis.annotate(cell.profile, (a.value, b.value), xytext=(4, 4),
                              textcoords="offset points", fontsize=6.5)  # fmt: skip
                rows.append({"cell": cell.name, x: a.value, y: b.value})
        axis.set_xlabel(across.heading)
        axis.set_ylabel(up.heading)
        axis.set_ylim(bottom=0)
        axis.legend(loc="best")
        title = f"{up.label[0].upper() + up.label[1:]} against {across.label}: {dataset}"
        axis.set_title(title)
        writer.save(
            made,
            file_name("tradeoff", dataset, x, y),
            title,
            "One point per cell with 95 % intervals; lines join the cells of a system.",
            pd.DataFrame(rows),
        )
    return True
