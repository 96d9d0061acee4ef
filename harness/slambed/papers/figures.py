# SPDX-License-Identifier: Apache-2.0
"""Draws a paper's figures of single events with ours: when something was sent, or how large
corrections were. They are SVG inside the page."""

import io
from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from slambed.papers.compare import Column, PaperVerdicts
from slambed.papers.lookup import pool_of
from slambed.papers.measured import measure
from slambed.papers.published import PublishedFigure, cells_of
from slambed.papers.published.published_tables import Drawn
from slambed.papers.strip import escaped
from slambed.report.load import Results
from slambed.report.style import color, dash, figure, lay_out, legend_beneath

LANE_IN, AROUND_IN = 0.22, 0.5
"""Height of a row of marks, and of what is around all rows."""
CURVES_IN = 2.4


@dataclass(frozen=True)
class DrawnFigure:
    """One figure of the paper with the events of our runs."""

    label: str
    shows: str
    svg: str
    note: str


@dataclass(frozen=True)
class Curve:
    """The events of one cell."""

    label: str
    values: list[float]
    """Run times in seconds, or values of a field."""
    runs: int


def drawn_figures(
    verdicts: PaperVerdicts, column: Column, experiments: list[Results]
) -> list[DrawnFigure]:
    """Returns the declared drawings for one kind of engine; those without any run are left out."""
    found = []
    for asked in verdicts.paper.figures:
        if asked.drawn is None:
            continue
        curves = _curves(verdicts, column, experiments, asked)
        if curves:
            label = f"{asked.label}, ours: {asked.shows}"
            svg = _svg(curves, asked.drawn, label)
            found.append(DrawnFigure(asked.label, asked.shows, svg, _note(asked.drawn, curves)))
    return found


def _note(drawn: Drawn, curves: list[Curve]) -> str:
    if drawn.kind == "times":
        return "One mark per event, one run per row."
    counts = sorted({curve.runs for curve in curves})
    runs = f"{counts[0]} to {counts[-1]}" if len(counts) > 1 else f"{counts[0]}"
    return f"Share of all events with at most this value; {runs} runs per curve."


def _curves(
    verdicts: PaperVerdicts, column: Column, experiments: list[Results], figure: PublishedFigure
) -> list[Curve]:
    assert figure.drawn is not None
    paper, drawn = verdicts.paper, figure.drawn
    pool = pool_of(experiments).of_engine(column.engine)
    cells = cells_of(paper)
    found = []
    for name in drawn.cells:
        cell = cells[name]
        own = measure(paper, pool.about(paper, cell.source), cell.metric, cell.system,
                      cell.conditions)  # fmt: skip
        keys = own.keys[:1] if drawn.kind == "times" else own.keys
        logs = [pool.results[folder].events(key, (drawn.event,)) for folder, key in keys]
        events = [e for log in logs if log is not None for e in log.of(drawn.event)]
        values = [_value(drawn, event) for event in events if _counts(drawn, event)]
        if values:
            place = cell.column.replace("_", " ")
            if drawn.kind == "times":
                place = f"{cell.row.partition(',')[0]}, {place}"
            found.append(Curve(place, sorted(values), len(logs)))
    return found


def _counts(drawn: Drawn, event: dict[str, Any]) -> bool:
    return all(event.get(name) == value for name, value in drawn.only.items())


def _value(drawn: Drawn, event: dict[str, Any]) -> float:
    return float(event[drawn.field]) if drawn.field else event["t_ns"] * 1e-9


def _svg(curves: list[Curve], drawn: Drawn, label: str) -> str:
    """Returns the drawing; its text stays text, which readers can search and hear."""
    times = drawn.kind == "times"
    height_in = AROUND_IN + LANE_IN * len(curves) if times else CURVES_IN
    with figure(height_in=height_in) as (made, (axis,)), plt.rc_context({"svg.fonttype": "none"}):
        if times:
            _times(axis, curves)
        else:
            _distribution(axis, curves)
            legend_beneath(made, axis)
        axis.set_xlabel(drawn.unit)
        axis.set_xlim(left=0.0)
        lay_out(made)
        out = io.StringIO()
        made.savefig(out, format="svg", metadata={"Date": None})
    svg = out.getvalue()
    opening = f'<svg class="drawn" role="img" aria-label="{escaped(label)}" '
    return opening + svg[svg.index("<svg ") + len("<svg ") :]


def _times(axis: Axes, curves: list[Curve]) -> None:
    rows = range(len(curves))
    axis.eventplot(
        [curve.values for curve in curves],
        lineoffsets=list(rows),
        linelengths=0.7,
        linewidths=1.2,
        colors=[color(row) for row in rows],
    )
    axis.set_yticks(rows, [curve.label for curve in curves])
    axis.set_ylim(len(curves) - 0.5, -0.5)
    axis.grid(visible=False, axis="y")


def _distribution(axis: Axes, curves: list[Curve]) -> None:
    for number, curve in enumerate(curves):
        axis.ecdf(curve.values, color=color(number), linestyle=dash(number), label=curve.label)
    axis.set_ylabel("share of events")
    axis.set_ylim(0.0, 1.02)
