# SPDX-License-Identifier: Apache-2.0
"""Draws trade-off curves: what cells cost against what they achieve, joined by system."""

from typing import Any

import pandas as pd
from matplotlib.lines import Line2D

from slambed.metrics.catalog import metric
from slambed.report.cells import Cell, intervals_or_ranges
from slambed.report.style import (
    COLORS,
    GROUND_TRUTH,
    MARKERS,
    FigureWriter,
    color,
    dash,
    figure,
    file_name,
    legend_beneath,
    marker,
)

PAIRS = (
    ("mobile_cpu_percent_mean", "ate_rmse_m"),
    ("mobile_cpu_percent_mean", "lost"),
    ("bytes_up", "ate_rmse_m"),
    ("link_mbit_s", "reference_rmse_m"),
    ("rtt_asked_ms_mean", "reference_rmse_m"),
    ("rtt_asked_ms_mean", "response_ms_median"),
    ("rtt_asked_ms_mean", "lost"),
    ("rtt_asked_ms_mean", "update_computed_ms_median"),
)

MINIMUM_PLACES = 3
"""Fewest points: two are a comparison, not a curve."""
SHAPES = (*MARKERS, "<", ">", "*", "p", "h")
"""One shape per link profile."""
HEIGHT_IN = 3.5


def draw_tradeoff(cells: list[Cell], dataset: str, x: str, y: str, writer: FigureWriter) -> bool:
    """Draws medians (or shares) with intervals; returns False if too few cells differ along the x
    axis."""
    shown = [c for c in cells if c.dataset == dataset and x in c.values and y in c.values]
    if len({f"{c.values[x].value:.2g}" for c in shown}) < MINIMUM_PLACES:
        return False
    across, up = metric(x), metric(y)
    labels = list(dict.fromkeys(cell.label for cell in cells))
    profiles = list(dict.fromkeys(cell.profile for cell in shown))
    rows: list[dict[str, object]] = []
    with figure(height_in=HEIGHT_IN) as (made, axes):
        axis = axes[0]
        handles: list[Line2D] = []
        for label in dict.fromkeys(cell.label for cell in shown):
            index = labels.index(label)
            # When colors repeat, hollow points distinguish the systems.
            face = color(index) if index < len(COLORS) else "white"
            own = sorted((c for c in shown if c.label == label), key=lambda c: c.values[x].value)
            xs = [cell.values[x].scaled(across.scale) for cell in own]
            ys = [cell.values[y].scaled(up.scale) for cell in own]
            axis.errorbar(
                [v.value for v in xs],
                [v.value for v in ys],
                xerr=[[v.value - v.low for v in xs], [v.high - v.value for v in xs]],
                yerr=[[v.value - v.low for v in ys], [v.high - v.value for v in ys]],
                color=color(index),
                linestyle=dash(index),
                elinewidth=0.8,
                capsize=2,
                linewidth=0.9,
                clip_on=False,
            )
            look: Any = {"color": color(index), "markerfacecolor": face}
            for cell, a, b in zip(own, xs, ys, strict=True):
                shape = SHAPES[profiles.index(cell.profile) % len(SHAPES)]
                axis.plot(
                    a.value,
                    b.value,
                    shape if len(profiles) > 1 else marker(index),
                    markersize=5,
                    clip_on=False,
                    zorder=3,
                    **look,
                )
                rows.append({"cell": cell.name, **_stored(cell, x), **_stored(cell, y)})
            if len(profiles) == 1:
                look["marker"] = marker(index)
            handles.append(Line2D([], [], linestyle=dash(index), label=label, **look))
        if len(profiles) > 1:
            handles += [
                Line2D(
                    [],
                    [],
                    color=GROUND_TRUTH,
                    marker=SHAPES[i % len(SHAPES)],
                    markersize=5,
                    linestyle="none",
                    label=profile,
                )
                for i, profile in enumerate(profiles)
            ]
        axis.set_xlabel(across.heading)
        axis.set_ylabel(up.heading)
        axis.set_ylim(bottom=0)
        legend_beneath(made, axis, handles)
        drawn = [cell.values[key] for cell in shown for key in (x, y)]
        title = f"{up.title} against {across.name}: {dataset}"
        axis.set_title(title)
        writer.save(
            made,
            file_name("tradeoff", dataset, x, y),
            title,
            f"One point per combination with {intervals_or_ranges(drawn)}; lines join those of a "
            "system" + (", shapes distinguish the link profiles." if len(profiles) > 1 else "."),
            pd.DataFrame(rows),
        )
    return True


def _stored(cell: Cell, key: str) -> dict[str, float]:
    """Returns a value with its interval under the metric's key, in its stored unit."""
    found = cell.values[key]
    return {key: found.value, f"{key}_low": found.low, f"{key}_high": found.high}
