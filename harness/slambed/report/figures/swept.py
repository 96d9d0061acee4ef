# SPDX-License-Identifier: Apache-2.0
"""Draws the experiment's metrics over a swept value: a line per system and per combination of the
other varied values."""

import json
import re
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from math import nan
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from slambed.errors import SlambedError
from slambed.metrics.catalog import keys_for
from slambed.metrics.metric import Metric, Use
from slambed.metrics.statistics import Floats, finite
from slambed.report.cells import estimate, metrics_asked, text
from slambed.report.figures.sweep import LEFT, RIGHT, STRATEGY, WHERE, sweeps
from slambed.report.load import Results
from slambed.report.style import (
    SQUEEZED_SHARE,
    FigureWriter,
    color,
    dash,
    figure,
    file_name,
    legend_beneath,
    marker,
)
from slambed.spec.library import Library

SWEEP = [*STRATEGY, *WHERE]
"""Columns that identify a strategy's sweep."""
PARAMS, RTT, LOSS = "params.", "link.rtt_ms", "link.loss"
IN_WORDS = ("name", "description", "source", "duration_s")
"""Keys of a profile that change nothing of what packets meet."""
NOTHING_ELSE = {RTT: "RTT alone", LOSS: "loss alone"}
"""What a link is called that does nothing besides."""
LEAST_VALUES = 3
"""Fewest values: two points are a comparison, not a curve."""
MOST_LINES = 5
"""Most lines in one pair of axes; more become small multiples."""
MOST_METRICS, MOST_PANELS = 6, 12
METRICS_APART = 4
"""Most metrics with small multiples, which have a figure per metric."""
COLUMNS = 2
PANEL_IN, AROUND_IN = 1.75, 0.7
MOST_TICKS = 16
LETTER = 0.021
"""Width of a tick label's character, as a fraction of the width of one column."""
LOG_FROM = 20.0
"""Ratio of largest to smallest value from which on the axis is logarithmic."""
MANY_RUNS = 20
"""Runs per value above which their points are lighter."""
BESIDE = 0.012
"""Offset between the runs of two lines, as a fraction of the axis."""
WRAPPED_AT = 28
QUARTILES = (0.25, 0.5, 0.75)


@dataclass(frozen=True)
class Axis:
    """The swept value: a parameter, or the round-trip time or packet loss of the link."""

    key: str
    name: str
    heading: str


@dataclass(frozen=True)
class Line:
    """Runs that differ only in the swept value (and their seeds)."""

    system: str
    """The label without the varied values."""
    point: str
    """The other varied values, which all its runs share: `n_orb 500, rtt_40`."""
    dataset: str
    runs: pd.DataFrame
    values: pd.Series
    """The swept value of each run."""


@dataclass(frozen=True)
class Swept:
    """All lines over one axis on one dataset."""

    axis: Axis
    dataset: str
    lines: list[Line]

    @property
    def runs(self) -> pd.DataFrame:
        return pd.concat([line.runs for line in self.lines])


@dataclass(frozen=True)
class Panel:
    """One pair of axes: a metric of some lines, each with its index among all lines of the
    figure."""

    title: str
    item: Metric
    lines: list[tuple[int, Line]]


def swept(results: Results) -> Iterator[Swept]:
    """Yields the lines per axis of at least LEAST_VALUES numbers and per dataset. A strategy's
    parameter with its own figure (figures/sweep.py) is left out."""
    runs = results.valid_runs
    parameters = [
        str(name)
        for name in runs
        if str(name).startswith(PARAMS) and runs[name].nunique(dropna=False) > 1
    ]
    own_form = {own.key for own in sweeps(results)} if _has_both(runs) else set()
    for key in [*parameters, RTT, LOSS]:
        if key in (RTT, LOSS):
            values, rest = _split_links(runs["profile"].map(text), results, key)
        else:
            values, rest = _numbers(runs[key]), runs["profile"].map(text)
        if values.nunique() < LEAST_VALUES:
            continue
        lines = [
            line
            for line in _lines(runs[values.notna()], values, rest, key, parameters)
            if (*line.runs.iloc[0][SWEEP].map(text), key) not in own_form
        ]
        axis = _axis(key, lines)
        for dataset in dict.fromkeys(line.dataset for line in lines):
            yield Swept(axis, dataset, [x for x in lines if x.dataset == dataset])


def _split_links(
    names: pd.Series, results: Results, key: str
) -> tuple["pd.Series[float]", "pd.Series[str]"]:
    """Returns the swept value of the link of each run, and the rest of the link in words."""
    links = {name: _split(name, results.links.get(name), key) for name in names.unique()}
    values = names.map({name: link.value for name, link in links.items()}).astype(float)
    return values, names.map({name: link.rest for name, link in links.items()})


def _has_both(runs: pd.DataFrame) -> bool:
    return all(key in runs and runs[key].notna().any() for key in (LEFT, RIGHT))


def _numbers(column: pd.Series) -> pd.Series:
    """Returns the numbers of a column; NaN for others, including true and false."""
    flags = column.map(lambda value: isinstance(value, bool))
    return pd.to_numeric(column.mask(flags), errors="coerce").astype(float)


@dataclass(frozen=True)
class LinkParts:
    """A link as one number and everything else."""

    value: float
    """RTT in ms, or share of lost packets; NaN if it is not constant."""
    rest: str
    """What else the link does, in words; empty for nothing."""


def _split(name: str, content: Mapping[str, Any] | None, key: str) -> LinkParts:
    """Splits a link's profile into a constant RTT (or its random loss) and the rest. A profile
    without its content, as in older results, is known by the names that grids give (`rtt_40`)."""
    if name in ("", "none"):
        return LinkParts(0.0, "")
    if content is None:
        named = re.fullmatch(r"rtt_(\d+(?:\.\d+)?)", name)
        return LinkParts(float(named[1]) if named and key == RTT else nan, "")
    others = {k: v for k, v in content.items() if k not in IN_WORDS}
    value = others.pop("rtt_ms", None) if key == RTT else _random_loss(others.pop("loss", None))
    if isinstance(value, bool) or not isinstance(value, int | float):
        value = nan
    return LinkParts(float(value), _rest(others))


def _random_loss(loss: object) -> object:
    if loss is None:
        return 0.0
    return loss.get("random") if isinstance(loss, dict) and set(loss) == {"random"} else None


def _rest(others: Mapping[str, Any]) -> str:
    """Returns these keys of a profile in words."""
    parts = []
    for key, value in others.items():
        if key == "rtt_ms" and isinstance(value, int | float):
            parts.append(f"RTT {value:g} ms")
        elif key == "loss" and isinstance(share := _random_loss(value), float | int):
            parts.append(f"loss {100 * share:g} %")
        elif value not in (None, [], {}):
            parts.append(f"{key} {json.dumps(value, sort_keys=True)}")
    return ", ".join(parts)


def _lines(
    runs: pd.DataFrame, values: pd.Series, rest: pd.Series, key: str, parameters: list[str]
) -> Iterator[Line]:
    """Yields groups of runs in which only this key has several values. `rest`: what else there is
    of the link of each run, in words; its name where no part of the link is swept."""
    of_link = key in (RTT, LOSS)
    leaf = key.rpartition(".")[2]
    own = values.loc[runs.index]
    names = [
        text(label) if of_link else _without(text(label), leaf, value)
        for label, value in zip(runs["label"], own, strict=True)
    ]
    fixed = ["system", "variant", "device_mobile", "device_edge", "dataset", "engine", "pace"]
    # Missing values become empty text, so that parameters that a system lacks count as equal.
    by = [runs[name].map(text) for name in (*fixed, *(p for p in parameters if p != key))]
    by += [rest.loc[runs.index], pd.Series(names, index=runs.index)]
    others = [p for p in parameters if p != key and _is_varied(runs, p)]
    links = rest.loc[runs.index].nunique(dropna=False) > 1
    for group, rows in runs.groupby(by, sort=False):
        line = own.loc[rows.index]
        cells = pd.DataFrame({"value": line, "cell": rows["cell"]})
        if line.nunique() < LEAST_VALUES or cells.groupby("value")["cell"].nunique().max() > 1:
            continue
        first = rows.iloc[0]
        name, point = str(group[-1]), []
        for other in others:
            found = first[other]
            leaf = other.removeprefix(PARAMS)
            if found == found and (shorter := _without(name, leaf, found)):
                name = shorter
                point.append(f"{leaf} {_word(found)}")
        point += [str(group[-2]) or NOTHING_ELSE.get(key, "no link")] if links else []
        yield Line(name, ", ".join(point), text(first["dataset"]), rows, line)


def _is_varied(runs: pd.DataFrame, parameter: str) -> bool:
    """Returns whether one system has several values of it."""
    return bool(runs.groupby(["system", "variant"])[parameter].nunique().gt(1).any())


def _word(value: object) -> str:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return f"{value:g}" if number else str(value)


def _without(label: str, leaf: str, value: object) -> str:
    """Returns a label without the swept value: `static n_orb 500` and `static 500` become `static`.
    Empty if the label does not contain the value."""
    words = "|".join(re.escape(word) for word in dict.fromkeys((_word(value), str(value))))
    found = re.sub(
        rf"[,\s]*(?:\b{re.escape(leaf)}\s+)?(?<![\w.])(?:{words})(?![\w.])(?:\s(?:[smM%]|ms|Hz)(?!\w))?",
        "",
        label,
        count=1,
    )
    return found.strip(" ,:") if found != label else ""


def _axis(key: str, lines: list[Line]) -> Axis:
    if key == RTT:
        return Axis(key, "RTT", "RTT added by the link [ms]")
    if key == LOSS:
        return Axis(key, "packet loss", "share of packets lost in each direction")
    name = key.removeprefix(PARAMS)
    units: set[str] = set()
    for system in {str(line.runs["system"].iloc[0]) for line in lines}:
        try:
            units.add(Library().system(system).params[name].unit)
        except (SlambedError, KeyError):
            continue  # an unknown system, or one without this parameter
    unit = units.pop() if len(units) == 1 else ""
    return Axis(key, name, f"{name} [{unit}]" if unit else name)


def metrics_over(results: Results, found: Swept) -> list[Metric]:
    """Returns the experiment's metrics, else the tested ones; only measured ones."""
    numbers, runs = results.numbers(), found.runs
    asked = [key for key in metrics_asked(results) if key in numbers]
    items = [results.metric(key) for key in asked or keys_for(Use.TESTED)]
    return [x for x in items if x.key in runs and len(finite(runs[x.key].to_numpy()))]


def draw_swept(results: Results, found: Swept, writer: FigureWriter) -> None:
    """Draws all metrics in one figure if there are few lines, else a figure per metric, with links
    or systems side by side."""
    metrics = metrics_over(results, found)
    lines = _named(found.lines)
    where = f"against {found.axis.name}: {found.dataset}"
    name = ("swept", found.dataset, found.axis.name)
    if len(lines) <= MOST_LINES:
        all_lines = list(enumerate(lines))
        panels = [Panel(m.title, m, all_lines) for m in metrics[:MOST_METRICS]]
        left_out = _left_out(len(metrics) - len(panels), "metric")
        legend = [_legend(line, lines) for line in lines]
        _draw(found.axis, panels, legend, f"Metrics {where}", file_name(*name), left_out, writer)
        return
    for item in metrics[:METRICS_APART]:
        panels, legend = _multiples(item, lines)
        more = _left_out(len(panels) - MOST_PANELS, "panel")
        more += _left_out(len(metrics) - METRICS_APART, "metric")
        _draw(
            found.axis,
            panels[:MOST_PANELS],
            legend,
            f"{item.title} {where}",
            file_name(*name, item.key),
            more,
            writer,
        )


def _named(lines: list[Line]) -> list[Line]:
    """Names lines by system and variant if their label does not contain the swept value."""
    found = []
    for line in lines:
        first = line.runs.iloc[0]
        usual = f"{text(first['system'])}:{text(first['variant'])}".removesuffix(":default")
        found.append(line if line.system else replace(line, system=usual))
    return found


def _legend(line: Line, lines: list[Line]) -> str:
    """Returns what distinguishes a line from the others."""
    parts = [
        part
        for part, all_of_them in (
            (line.system, {x.system for x in lines}),
            (line.point, {x.point for x in lines}),
        )
        if len(all_of_them) > 1
    ]
    return ", ".join(parts) or line.system


def _multiples(item: Metric, lines: list[Line]) -> tuple[list[Panel], list[str]]:
    """Returns a panel per combination of other varied values with a line per system, or vice versa,
    or panels of some lines each; and the legend."""
    systems = list(dict.fromkeys(line.system for line in lines))
    points = list(dict.fromkeys(line.point for line in lines))
    if len(points) > 1 and len(systems) <= MOST_LINES:
        own = {p: [(systems.index(x.system), x) for x in lines if x.point == p] for p in points}
        return [Panel(point, item, some) for point, some in own.items()], systems
    if 1 < len(points) <= MOST_LINES:
        own = {s: [(points.index(x.point), x) for x in lines if x.system == s] for s in systems}
        return [Panel(system, item, some) for system, some in own.items()], points
    legend = [_legend(line, lines) for line in lines]
    numbered = list(enumerate(lines))
    parts = range(0, len(numbered), MOST_LINES)
    return [Panel("", item, numbered[i : i + MOST_LINES]) for i in parts], legend


def _left_out(count: int, what: str) -> str:
    return f" {count} more {what}{'' if count == 1 else 's'} left out." if count > 0 else ""


def _draw(
    axis: Axis,
    panels: list[Panel],
    legend: list[str],
    title: str,
    name: str,
    more: str,
    writer: FigureWriter,
) -> None:
    if not panels:
        return
    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    data: list[pd.DataFrame] = []
    from_zero = True
    with figure(rows, columns, height_in=AROUND_IN + PANEL_IN * max(rows, 1.4)) as (made, axes):
        for place, panel in zip(axes, panels, strict=False):
            data += _panel(place, axis, panel, legend, columns)
            place.set_title(textwrap.fill(panel.title, WRAPPED_AT if columns > 1 else 70))
        for place in axes[len(panels) :]:
            place.remove()
        shown = axes[: len(panels)]
        if len({panel.item.key for panel in panels}) == 1:
            _same_heights(shown)
        for index, (place, panel) in enumerate(zip(shown, panels, strict=True)):
            from_zero &= _heights(place, panel.item)
            if panel.item.shown_unit:  # the title has the name
                place.set_ylabel(f"[{panel.item.shown_unit}]")
            if index + columns >= len(panels):
                place.set_xlabel(axis.heading)
        made.suptitle(title, fontsize=10)
        used = sorted({index for panel in panels for index, _ in panel.lines})
        handles = [
            Line2D([], [], color=color(i), linestyle=dash(i), marker=marker(i), label=legend[i])
            for i in used
        ]
        legend_beneath(made, axes[0], handles)
        caption = (
            "Lines: medians of the valid runs, with quartiles as bands and the runs as "
            "light points; shares with 95 % Wilson intervals."
            + ("" if from_zero else " Not all axes begin at 0.")
            + more
        )
        writer.save(made, name, title, caption, pd.concat(data, ignore_index=True))


def _panel(
    place: Axes, axis: Axis, panel: Panel, legend: list[str], columns: int
) -> Iterator[pd.DataFrame]:
    every = sorted({float(v) for _, line in panel.lines for v in line.values})
    logarithmic = every[0] > 0 and every[-1] / every[0] >= LOG_FROM
    if logarithmic:
        place.set_xscale("log")
    _ticks(place, every, logarithmic, columns)
    for index, line in panel.lines:
        curve = _curve(line, panel.item)
        if not len(curve):
            continue
        x = curve["value"].to_numpy(np.float64)
        y, low, high = (curve[name].to_numpy(np.float64) for name in ("middle", "low", "high"))
        look: Any = {"color": color(index), "linestyle": dash(index), "marker": marker(index)}
        across = (index % MOST_LINES - (len(panel.lines) - 1) / 2) * BESIDE
        if panel.item.kind == "share":
            # Bands of shares would overlap, because lines without any loss are identical.
            x = _beside(x, across, logarithmic)
            place.errorbar(
                x,
                y,
                yerr=[y - low, high - y],
                label=legend[index],
                capsize=2,
                elinewidth=0.8,
                **look,
            )
        else:
            place.fill_between(x, low, high, color=color(index), alpha=0.13, linewidth=0)
            place.plot(x, y, label=legend[index], **look)
            _points(place, line, panel.item, index, across, logarithmic)
        labels = {"line": legend[index], "panel": panel.title, "metric": panel.item.key}
        named = curve.rename(columns={"value": axis.name})
        yield named.assign(**labels)


def _curve(line: Line, item: Metric) -> pd.DataFrame:
    """Returns median and quartiles at every value in the shown unit, or shares with their interval.
    Infinite values, because half of the runs failed, are gaps."""
    rows = []
    for value, runs in line.runs.groupby(line.values):
        measured = finite(runs[item.key].to_numpy()) * item.scale
        if not len(measured):
            continue
        if item.kind == "share" and (found := estimate(runs, item)) is not None:
            share = found.scaled(item.scale)
            low, middle, high = share.low, share.value, share.high
        else:
            # Quantiles cannot be interpolated between a number and infinity.
            exact = bool(np.isfinite(measured).all())
            low, middle, high = np.quantile(
                measured, QUARTILES, method="linear" if exact else "inverted_cdf"
            )
        rows.append(
            {"value": value, "low": low, "middle": middle, "high": high, "runs": len(measured)}
        )
    return pd.DataFrame(rows).replace([np.inf, -np.inf], np.nan)


def _points(
    place: Axes, line: Line, item: Metric, index: int, across: float, logarithmic: bool
) -> None:
    """Draws every run as a point, with those of several lines next to each other."""
    x = _beside(line.values.to_numpy(np.float64), across, logarithmic)
    y = pd.to_numeric(line.runs[item.key].astype(object), errors="coerce").to_numpy(np.float64)
    many = len(y) > MANY_RUNS * line.values.nunique()
    place.plot(
        x,
        y * item.scale,
        ".",
        color=color(index),
        alpha=0.1 if many else 0.3,
        markersize=3.5,
        zorder=1.5,
        label="a run",
    )


def _beside(x: Floats, across: float, logarithmic: bool) -> Floats:
    """Shifts x by this fraction of the axis."""
    found: Floats = x * (x.max() / x.min()) ** across if logarithmic else x + across * np.ptp(x)
    return found


def _ticks(place: Axes, values: list[float], logarithmic: bool, columns: int) -> None:
    """Sets ticks at the values, with labels where they fit."""
    if len(values) > MOST_TICKS:
        return
    at = np.log(values) if logarithmic else np.array(values)
    shares = (at - at[0]) / np.ptp(at)
    names: list[str] = []
    free = -1.0
    for share, value in zip(shares, values, strict=True):
        name = f"{value:g}"
        half = LETTER * columns * len(name) / 2
        names.append(name if share - half >= free else "")
        free = share + half + LETTER * columns if names[-1] else free
    place.set_xticks(values, names)
    place.minorticks_off()


def _same_heights(places: list[Axes]) -> None:
    limits = list(chain.from_iterable(place.get_ylim() for place in places))
    for place in places:
        place.set_ylim(min(limits), max(limits))


def _heights(place: Axes, item: Metric) -> bool:
    """Starts the y axis at 0 unless that would squeeze the lines; returns whether it does."""
    low, high = place.get_ylim()
    if item.kind == "share" or item.largest_shown < float("inf"):
        high = min(high, item.largest_shown * 1.03)
    if low < SQUEEZED_SHARE * high or low <= 0:
        place.set_ylim(min(0.0, low) if low < -0.05 * high else 0.0 - 0.02 * high, high)
        return True
    place.set_ylim(low, high)
    return False
