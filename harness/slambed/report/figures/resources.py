# SPDX-License-Identifier: Apache-2.0
"""Draws CPU and memory of both nodes over time: the mean over runs with their range."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from slambed.report.conditions import Condition, some_runs
from slambed.report.load import Results
from slambed.report.style import FigureWriter, color, dash, figure, file_name, legend_beneath

BIN_S = 1.0
"""Samples come at 10 Hz; a bin of 1 s averages over quota periods."""


@dataclass(frozen=True)
class Quantity:
    """A column of the samples in a figure."""

    column: str
    name: str
    title: str
    unit: str


CPU = Quantity("cpu_percent", "cpu", "CPU", "% of one core")
MEMORY = Quantity("memory_mb", "memory", "Memory", "MiB")


def draw_over_time(
    results: Results, condition: Condition, quantity: Quantity, writer: FigureWriter
) -> None:
    """Draws one panel per node, with one line per system."""
    parts: list[pd.DataFrame] = []
    for label, runs in condition.systems():
        for key in some_runs(runs):
            samples = results.table(key, "samples")
            if samples is not None and quantity.column in samples:
                parts.append(_binned(samples, quantity.column, runs, key).assign(label=label))
    parts = [part for part in parts if len(part)]
    if not parts:
        return
    data = pd.concat(parts, ignore_index=True)
    curves = (
        data.groupby(["node", "label", "t_s"], sort=False)["value"]
        .agg(mean="mean", low="min", high="max", runs="size")
        .reset_index()
    )
    nodes = [node for node in ("mobile", "edge") if (curves["node"] == node).any()]
    labels = list(dict.fromkeys(data["label"]))
    with figure(len(nodes), height_in=1.2 + 1.9 * len(nodes), sharex=True) as (made, axes):
        for axis, node in zip(axes, nodes, strict=True):
            for label in labels:
                index = condition.number(label)
                own = curves[(curves["node"] == node) & (curves["label"] == label)]
                own = own.sort_values("t_s")
                if own.empty:
                    continue
                axis.plot(
                    own["t_s"], own["mean"], color=color(index), linestyle=dash(index), label=label
                )
                axis.fill_between(
                    own["t_s"], own["low"], own["high"], color=color(index), alpha=0.15, linewidth=0
                )
            axis.set_ylabel(f"{node} [{quantity.unit}]")
            axis.set_ylim(bottom=0)
        axes[-1].set_xlabel("time [s]")
        legend_beneath(made, axes[0])
        title = f"{quantity.title} over time: {condition.title}"
        axes[0].set_title(title)
        writer.save(
            made,
            file_name(quantity.name, condition.dataset, condition.profile),
            title,
            f"Mean of up to {int(curves['runs'].max())} runs per system in bins of {BIN_S:g} s; "
            "the band is the range of the runs.",
            curves,
        )


def _binned(samples: pd.DataFrame, column: str, runs: pd.DataFrame, key: str) -> pd.DataFrame:
    end_s = pd.to_numeric(runs.loc[runs["run_key"] == key, "wall_s"]).iloc[0]
    inside = samples[samples["t_s"].between(0, end_s if end_s == end_s else np.inf)]
    inside = inside.dropna(subset=[column])
    bins = (inside["t_s"] // BIN_S) * BIN_S + BIN_S / 2
    grouped = inside.groupby([inside["node"], bins])[column].mean()
    return grouped.rename_axis(["node", "t_s"]).rename("value").reset_index()
