# SPDX-License-Identifier: Apache-2.0
"""`slambed gate --publish`: writes the history of nights as a static page over commits."""

from collections.abc import Callable
from math import isfinite
from pathlib import Path

import pandas as pd
from markupsafe import Markup, escape

from slambed.files.atomic import replacing
from slambed.files.outputs import make_folder, writing
from slambed.regression.trends import ExperimentTrends, Point, Step, Trend, trends_of
from slambed.report.page import render

PAGE, POINTS = "index.html", "points.csv"
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 340.0, 132.0, 46.0, 8.0, 10.0, 24.0
SHORT_COMMIT = 7


def publish(history: pd.DataFrame, folder: Path, link: str = "") -> Path:
    """Writes the page, and all its points as a table. `link` is an address to which a commit is
    appended; without it, commits are not links."""
    make_folder(folder, "--publish")
    found = trends_of(history)
    steps = sorted((s for e in found for s in e.steps), key=lambda s: s.night, reverse=True)
    page = render(
        "trends.html.j2",
        "slambed.regression",
        experiments=[_shown(item, link) for item in found],
        steps=[_step(step, link) for step in steps],
        tiles=_tiles(found, steps),
    )
    with writing(folder / POINTS, "--publish"), replacing(folder / POINTS) as out:
        _table(found).to_csv(out, index=False)
    with writing(folder / PAGE, "--publish"), replacing(folder / PAGE) as out:
        out.write_text(page, encoding="utf-8")
    return folder / PAGE


def _tiles(found: list[ExperimentTrends], steps: list[Step]) -> list[tuple[str, str, str]]:
    nights = sorted({night for item in found for night in item.nights})
    worse = sum(step.worse for step in steps)
    trends = sum(len(of_cell) for item in found for of_cell in item.cells.values())
    return [
        (str(len(nights)), f"nights, {nights[0]} to {nights[-1]}" if nights else "nights", ""),
        (str(trends), "metrics of combinations", ""),
        (str(worse), "changes for the worse", "bad" if worse else ""),
        (str(len(steps) - worse), "changes for the better", "good" if len(steps) > worse else ""),
    ]


def _shown(found: ExperimentTrends, link: str) -> dict[str, object]:
    cells = [
        {
            "name": cell,
            "anchor": f"{found.name}-{index}",
            "worse": sum(step.worse for trend in trends for step in trend.steps),
            "trends": [
                {"heading": item.metric.heading, "last": _last(item), "svg": trend_svg(item, link)}
                for item in trends
            ],
        }
        for index, (cell, trends) in enumerate(found.cells.items())
    ]
    return {"name": found.name, "cells": cells}


def _last(trend: Trend) -> str:
    point = trend.points[-1]
    return f"{trend.metric.show(point.value.value)} {trend.metric.shown_unit}".rstrip()


def _step(step: Step, link: str) -> dict[str, object]:
    unit = step.metric.shown_unit
    change = ""
    if step.metric.kind != "share" and step.before and isfinite(step.after / step.before):
        change = f"{100 * (step.after / step.before - 1):+.0f} %"
    return {
        "night": step.night, "commit": commit_link(step.commit, link),
        "experiment": step.experiment, "cell": step.cell, "metric": step.metric.name,
        "values": f"{' → '.join(map(step.metric.show, (step.before, step.after)))} {unit}".strip(),
        "change": change, "p": f"{step.p_value:.2g}", "worse": step.worse,
    }  # fmt: skip


def commit_link(commit: str, link: str) -> Markup:
    """Returns a short commit hash, as a link if an address is given."""
    short = escape(commit[:SHORT_COMMIT])
    if not commit:
        return Markup("unknown")
    if not link:
        return Markup("<code>{}</code>").format(short)
    return Markup('<a href="{}"><code>{}</code></a>').format(link + commit, short)


def trend_svg(trend: Trend, link: str) -> Markup:
    """Draws medians with their intervals per night; squares mark changes for the worse, diamonds
    those for the better. Each point links to its commit and has a tooltip."""
    points = [p for p in trend.points if isfinite(p.value.value)]
    if not points:
        return Markup('<p class="soft">no finite value</p>')
    low, high = _range(trend, points)
    step_x = (WIDTH - LEFT - RIGHT) / max(len(points) - 1, 1)
    at = [LEFT + step_x * index if len(points) > 1 else WIDTH / 2 for index in range(len(points))]

    def y(value: float) -> float:
        share = (min(max(value, low), high) - low) / (high - low)
        return TOP + (1 - share) * (HEIGHT - TOP - BOTTOM)

    parts = [
        f'<svg class="trend" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" '
        f'aria-label="{escape(trend.metric.name)} over {len(points)} nights">',
        *_axis(trend, low, high, y),
    ]
    inside = [(x, p) for x, p in zip(at, points, strict=True)]
    parts += [
        f'<line class="interval" x1="{x:.1f}" x2="{x:.1f}" y1="{y(p.value.low):.1f}" '
        f'y2="{y(p.value.high):.1f}"/>'
        for x, p in inside
    ]
    path = " ".join(f"{x:.1f},{y(p.value.value):.1f}" for x, p in inside)
    parts.append(f'<polyline class="path" points="{path}"/>')
    marks = {step.night: step for step in trend.steps}
    for x, point in inside:
        parts.append(_mark(trend, point, x, y(point.value.value), marks.get(point.night), link))
    for x, point, anchor in ((at[0], points[0], "start"), (at[-1], points[-1], "end")):
        if anchor == "end" and len(points) == 1:
            continue
        parts.append(
            f'<text class="time" x="{x:.1f}" y="{HEIGHT - 7:g}" '
            f'text-anchor="{anchor if len(points) > 1 else "middle"}">{point.night}</text>'
        )
    return Markup("".join([*parts, "</svg>"]))


def _range(trend: Trend, points: list[Point]) -> tuple[float, float]:
    """Returns the range of all intervals, widened to a relevant change so that noise is not
    magnified."""
    ends = [end for p in points for end in (p.value.low, p.value.high, p.value.value)]
    finite = [end for end in ends if isfinite(end)]
    low, high = min(finite), max(finite)
    item = trend.metric
    least = max(item.relevant_step, item.relevant_share * abs(points[-1].value.value))
    room = max(2 * least - (high - low), 0.1 * (high - low), 1e-9) / 2
    return low - room, high + room


def _axis(trend: Trend, low: float, high: float, y: Callable[[float], float]) -> list[str]:
    ticks = [low + share * (high - low) for share in (0.1, 0.9)]
    return [
        f'<line class="rule" x1="{LEFT:g}" x2="{WIDTH - RIGHT:g}" y1="{y(v):.1f}" y2="{y(v):.1f}"/>'
        f'<text class="tick" x="{LEFT - 4:g}" y="{y(v) + 3:.1f}">{trend.metric.show(v)}</text>'
        for v in ticks
    ]


def _mark(trend: Trend, point: Point, x: float, y: float, step: Step | None, link: str) -> str:
    item, value = trend.metric, point.value
    words = (
        f"{point.night}, {point.commit[:SHORT_COMMIT] or 'commit unknown'}: "
        f"{item.show(value.value)} ({item.show(value.low)} to {item.show(value.high)})"
        + f" {item.shown_unit}".rstrip()
        + f", {value.count} runs"
        + ("" if point.passed else "; the regression gate was closed")
        + ("" if step is None else f"; {'worse' if step.worse else 'better'} than before")
    )
    if step is None:
        shape = f'<circle class="point" cx="{x:.1f}" cy="{y:.1f}" r="3"/>'
    elif step.worse:
        shape = f'<rect class="worse" x="{x - 5:.1f}" y="{y - 5:.1f}" width="10" height="10"/>'
    else:
        ends = f"{x:.1f},{y - 6:.1f} {x + 6:.1f},{y:.1f} {x:.1f},{y + 6:.1f} {x - 6:.1f},{y:.1f}"
        shape = f'<polygon class="better" points="{ends}"/>'
    inside = f"<title>{escape(words)}</title>{shape}"
    if link and point.commit:
        return f'<a href="{escape(link + point.commit)}">{inside}</a>'
    return f"<g>{inside}</g>"


def _table(found: list[ExperimentTrends]) -> pd.DataFrame:
    columns = ["experiment", "cell", "metric", "night_utc", "commit", "value", "low", "high",
               "runs", "gate_passed", "change"]  # fmt: skip
    rows = []
    for item in found:
        for cell, trends in item.cells.items():
            for trend in trends:
                marks = {s.night: "worse" if s.worse else "better" for s in trend.steps}
                rows += [
                    [
                        item.name,
                        cell,
                        trend.metric.key,
                        p.night,
                        p.commit,
                        p.value.value,
                        p.value.low,
                        p.value.high,
                        p.value.count,
                        p.passed,
                        marks.get(p.night, ""),
                    ]
                    for p in trend.points
                ]
    return pd.DataFrame(rows, columns=columns)
