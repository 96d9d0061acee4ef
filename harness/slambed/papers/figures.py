# SPDX-License-Identifier: Apache-2.0
"""Draws a paper's figures of single events with ours, as SVG: when something was sent, or how large
corrections were."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from slambed.papers.compare import Column, PaperVerdicts
from slambed.papers.lookup import pool_of
from slambed.papers.measured import measure
from slambed.papers.published import PublishedFigure, cells_of
from slambed.papers.published.published_tables import Drawn
from slambed.papers.strip import escaped
from slambed.report.load import Results
from slambed.report.style import color

WIDTH, LEFT, RIGHT = 640, 230, 12
LANE = 18
CURVES_HIGH = 180
TICKS = 5
STEPS = (1.0, 2.0, 5.0, 10.0)
"""Distances of ticks, times a power of ten."""


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
    for figure in verdicts.paper.figures:
        if figure.drawn is None:
            continue
        curves = _curves(verdicts, column, experiments, figure)
        if curves:
            draw = _times if figure.drawn.kind == "times" else _distribution
            svg = draw(curves, figure.drawn.unit, f"{figure.label}, ours: {figure.shows}")
            found.append(DrawnFigure(figure.label, figure.shows, svg, _note(figure.drawn, curves)))
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


def _times(curves: list[Curve], unit: str, label: str) -> str:
    end = max(max(curve.values) for curve in curves) or 1.0
    parts = []
    for row, curve in enumerate(curves):
        top = row * LANE
        parts.append(_lane(curve.label, top + LANE / 2))
        parts += [
            f'<line x1="{_x(value, end):.1f}" x2="{_x(value, end):.1f}" y1="{top + 3}" '
            f'y2="{top + LANE - 3}" stroke="{color(row)}" stroke-width="1.6"/>'
            for value in curve.values
        ]
    return _svg(parts, len(curves) * LANE, end, unit, label)


def _distribution(curves: list[Curve], unit: str, label: str) -> str:
    end = max(max(curve.values) for curve in curves) or 1.0
    parts = []
    for number, curve in enumerate(curves):
        shares = np.arange(1, len(curve.values) + 1) / len(curve.values)
        at, path = 0.0, [f"M{_x(0.0, end):.1f} {CURVES_HIGH}"]
        for value, share in zip(curve.values, shares, strict=True):
            path.append(f"L{_x(value, end):.1f} {_y(at):.1f}L{_x(value, end):.1f} {_y(share):.1f}")
            at = float(share)
        path.append(f"L{_x(end, end):.1f} {_y(1.0):.1f}")
        parts.append(
            f'<path d="{"".join(path)}" fill="none" stroke="{color(number)}" stroke-width="1.6">'
            f"<title>{escaped(curve.label)}</title></path>"
        )
        middle = 12 + number * LANE
        parts.append(_lane(curve.label, middle - 3.5))
        parts.append(
            f'<line x1="{LEFT - 44}" x2="{LEFT - 30}" y1="{middle - 4}" y2="{middle - 4}" '
            f'stroke="{color(number)}" stroke-width="2.4"/>'
        )
    parts += [
        f'<text class="tick" x="{LEFT - 12}" y="{_y(share) + 3.5:.1f}">{share:g}</text>'
        for share in (0.0, 0.5, 1.0)
    ]
    return _svg(parts, CURVES_HIGH, end, unit, label)


def _lane(label: str, middle: float) -> str:
    return f'<text class="lane" x="{LEFT - 50}" y="{middle + 3.5:.1f}">{escaped(label)}</text>'


def _x(value: float, end: float) -> float:
    return LEFT + (WIDTH - LEFT - RIGHT) * value / end


def _y(share: float) -> float:
    return CURVES_HIGH - (CURVES_HIGH - 6) * share


def _svg(parts: list[str], top: float, end: float, unit: str, label: str) -> str:
    power = 10.0 ** np.floor(np.log10(end / TICKS))
    step = next(power * n for n in STEPS if power * n * TICKS >= end)
    ticks = np.arange(0.0, end * (1 + 1e-9), step)
    axis = [
        f'<line class="tickline" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{top}" y2="{top}"/>',
        *(
            f'<text class="tick" x="{_x(float(tick), end):.1f}" y="{top + 14}">{tick:g}</text>'
            for tick in ticks
        ),
        f'<text class="lane" x="{WIDTH - RIGHT}" y="{top + 28}">{escaped(unit)}</text>',
    ]
    return (
        f'<svg class="strip" viewBox="0 0 {WIDTH} {top + 34:.0f}" role="img" '
        f'aria-label="{escaped(label)}">{"".join(parts)}{"".join(axis)}</svg>'
    )
