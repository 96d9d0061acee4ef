# SPDX-License-Identifier: Apache-2.0
"""Draws what a strategy's parameter costs and achieves: two axes over its values, as in CloudSLAM's
Figure 11."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from slambed.metrics.catalog import metric
from slambed.metrics.metric import Metric
from slambed.metrics.statistics import Interval
from slambed.report.cells import estimate, intervals_or_ranges, text
from slambed.report.load import Results
from slambed.report.style import FigureWriter, color, figure, file_name, legend_beneath, marker

LEAST_VALUES = 3
LEFT, RIGHT = "reference_rmse_m", "link_mbit_s"
STRATEGY = ("system", "variant", "dataset", "profile")
WHERE = ("engine", "pace", "device_mobile", "device_edge")


@dataclass(frozen=True)
class Sweep:
    """Runs of one variant on one dataset and link, of which only one number is varied."""

    system: str
    variant: str
    dataset: str
    profile: str
    column: str
    """The varied number: `params.<name>`."""
    runs: pd.DataFrame
    where: tuple[str, ...] = ()
    """Engine, pace and devices, in which runs of one curve may not differ."""
    apart: tuple[str, ...] = ()
    """System, link, engine, pace and devices, each only where sweeps that are otherwise called the
    same differ in it."""

    @property
    def key(self) -> tuple[str, ...]:
        """Returns what no other sweep shares."""
        return (self.system, self.variant, self.dataset, self.profile, *self.where, self.column)


def sweeps(results: Results) -> list[Sweep]:
    """Returns the runs wherever only one number is varied."""
    own = results.valid_runs
    keys = [*(own[name] for name in STRATEGY), *(own[name].map(text) for name in WHERE)]
    found: list[Sweep] = []
    for group, runs in own.groupby(keys, sort=False):
        columns = [c for c in runs if str(c).startswith("params.") and runs[c].nunique() > 1]
        if len(columns) != 1:
            continue
        numbers = pd.to_numeric(runs[columns[0]], errors="coerce")
        if numbers.notna().all() and numbers.nunique() >= LEAST_VALUES:
            system, variant, dataset, profile, *where = map(str, group)
            column = str(columns[0])
            found.append(Sweep(system, variant, dataset, profile, column, runs, tuple(where)))
    return [replace(sweep, apart=_apart(sweep, found)) for sweep in found]


def _apart(sweep: Sweep, others: list[Sweep]) -> tuple[str, ...]:
    """Returns what tells a sweep apart from those of the same variant, dataset and parameter."""

    def called(one: Sweep) -> tuple[str, str, str]:
        return one.variant, one.dataset, one.column

    same = [one for one in others if called(one) == called(sweep)]
    systems, profiles = {one.system for one in same}, {one.profile for one in same}
    parts = [(sweep.system, systems), (sweep.profile, profiles)]
    alike = [x.where for x in same if (x.system, x.profile) == (sweep.system, sweep.profile)]
    parts += [(own, {*names}) for own, *names in zip(sweep.where, *alike, strict=True)]
    return tuple(own for own, names in parts if own and len(names) > 1)


def draw_sweep(sweep: Sweep, writer: FigureWriter) -> bool:
    """Draws medians with intervals, error to the reference left and data rate right; returns False
    if there are too few."""
    left, right = metric(LEFT), metric(RIGHT)
    found = {item.key: _estimates(sweep, item) for item in (left, right)}
    if not all(len(own) >= LEAST_VALUES for own in found.values()):
        return False
    name = sweep.column.removeprefix("params.")
    curves = {key: _curve(name, own) for key, own in found.items()}
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
        where = ", ".join((sweep.variant, sweep.dataset, *sweep.apart))
        title = f"{left.title} and {right.name} against {name}: {where}"
        axis.set_title(title)
        drawn = [value for own in found.values() for value in own.values()]
        rows = [curve.assign(metric=key) for key, curve in curves.items()]
        writer.save(
            made,
            file_name("sweep", sweep.dataset, sweep.variant, name, *sweep.apart),
            title,
            f"Medians of the runs with {intervals_or_ranges(drawn)}.",
            pd.concat(rows, ignore_index=True),
        )
    return True


def _estimates(sweep: Sweep, item: Metric) -> dict[float, Interval]:
    """Returns the metric in its shown unit at every value of the parameter."""
    return {
        float(str(value)): found.scaled(item.scale)
        for value, runs in sweep.runs.groupby(pd.to_numeric(sweep.runs[sweep.column]))
        if (found := estimate(runs, item)) is not None
    }


def _curve(name: str, found: dict[float, Interval]) -> pd.DataFrame:
    return pd.DataFrame(
        [
            {name: value, "value": shown.value, "low": shown.low, "high": shown.high}
            for value, shown in found.items()
        ]
    )
