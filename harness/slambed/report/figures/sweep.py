# SPDX-License-Identifier: Apache-2.0
"""Draws what a strategy's parameter costs and achieves: two axes over its values, as in CloudSLAM's
Figure 11."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from slambed.metrics.catalog import metric
from slambed.metrics.metric import Metric
from slambed.report.cells import estimate
from slambed.report.load import Results
from slambed.report.style import FigureWriter, color, figure, file_name, legend_beneath, marker

LEAST_VALUES = 3
LEFT, RIGHT = "reference_rmse_m", "link_mbit_s"


def sweeps(results: Results) -> Iterator[tuple[str, str, str, str, pd.DataFrame]]:
    """Yields (system, variant, dataset, parameter, runs) wherever only one number is varied."""
    keys = ["system", "variant", "dataset", "profile"]
    for (system, variant, dataset, _), runs in results.valid_runs.groupby(keys, sort=False):
        columns = [c for c in runs if str(c).startswith("params.") and runs[c].nunique() > 1]
        if len(columns) != 1:
            continue
        numbers = pd.to_numeric(runs[columns[0]], errors="coerce")
        if numbers.notna().all() and numbers.nunique() >= LEAST_VALUES:
            yield str(system), str(variant), str(dataset), str(columns[0]), runs


def draw_sweep(
    results: Results,
    variant: str,
    dataset: str,
    column: str,
    runs: pd.DataFrame,
    writer: FigureWriter,
) -> bool:
    """Draws medians with intervals, error to the reference left and data rate right; returns False
    if there are too few."""
    left, right = metric(LEFT), metric(RIGHT)
    curves = {item.key: _curve(runs, column, item) for item in (left, right)}
    if not all(len(curve) >= LEAST_VALUES for curve in curves.values()):
        return False
    name = column.removeprefix("params.")
    with figure() as (made, axes):
        axis, other = axes[0], axes[0].twinx()
        for index, (item, place) in enumerate(((left, axis), (right, other))):
            curve = curves[item.key]
            low, high = curve["value"] - curve["low"], curve["high"] - curve["value"]
            place.errorbar(
                curve[name],
                curve["value"],
                yerr=np.array([low, high]),
                color=color(index),
                marker=marker(index),
                capsize=2,
                linewidth=0.9,
                label=item.title,
            )
            place.set_ylabel(item.heading, color=color(index))
            place.set_ylim(bottom=0)
        axis.set_xlabel(name)
        handles = [h for place in (axis, other) for h in place.get_legend_handles_labels()[0]]
        legend_beneath(made, axis, handles)
        title = f"{left.title} and {right.name} against {name}: {variant}, {dataset}"
        axis.set_title(title)
        rows = [curve.assign(metric=key) for key, curve in curves.items()]
        writer.save(
            made,
            file_name("sweep", dataset, variant, name),
            title,
            "Medians of the runs with 95 % intervals.",
            pd.concat(rows, ignore_index=True),
        )
    return True


def _curve(runs: pd.DataFrame, column: str, item: Metric) -> pd.DataFrame:
    rows = []
    for value, own in runs.groupby(pd.to_numeric(runs[column])):
        if (found := estimate(own, item)) is not None:
            shown = found.scaled(item.scale)
            name = column.removeprefix("params.")
            rows.append({name: value, "value": shown.value, "low": shown.low, "high": shown.high})
    return pd.DataFrame(rows)
