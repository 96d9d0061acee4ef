# SPDX-License-Identifier: Apache-2.0
"""SVG figures of an inference: intervals with printed numbers, and likelihood profiles."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from slambed.infer.design import shown
from slambed.infer.inference_plan import OpenItem
from slambed.infer.search import Evaluated, FitResult
from slambed.infer.success import ComparedCell
from slambed.papers.strip import escaped
from slambed.papers.verdicts.model import Share

WIDTH, LABEL, LANE = 420.0, 152.0, 17.0
INSIDE, OUTSIDE = "#009E73", "#D55E00"
PROFILE_WIDTH, PROFILE_HEIGHT, LEFT, BOTTOM, TOP = 330.0, 190.0, 40.0, 34.0, 10.0
DEEPEST = 60.0
"""Log units below the best; points further below are drawn at the lower edge."""
LETTERS = 28
"""Most characters of a lane's name."""


@dataclass(frozen=True)
class Lane:
    """One published share."""

    label: str
    compared: ComparedCell


def lanes_svg(lanes: Sequence[Lane], what: str) -> str:
    """Draws predicted shares with their 95 % intervals, and the printed ones, on one axis in
    percent. Empty if there is no share."""
    drawn = [lane for lane in lanes if isinstance(lane.compared.printed, Share)]
    if not drawn:
        return ""
    height = LANE * len(drawn) + 24
    parts = [_lane(lane, LANE * (n + 0.5)) for n, lane in enumerate(drawn)]
    base = LANE * len(drawn) + 2
    ticks = "".join(
        f'<line class="tickline" x1="{_x(p):.1f}" x2="{_x(p):.1f}" y1="0" y2="{base + 3:.0f}"/>'
        f'<text class="tick" x="{_x(p):.1f}" y="{base + 14:.0f}">{p} %</text>'
        for p in (0, 25, 50, 75, 100)
    )
    return (
        f'<svg class="lanes" viewBox="0 0 {WIDTH:.0f} {height:.0f}" role="img" '
        f'aria-label="{escaped(what)}">{ticks}{"".join(parts)}</svg>'
    )


def _x(percent: float) -> float:
    return LABEL + (WIDTH - LABEL - 20) * percent / 100


def _lane(lane: Lane, y: float) -> str:
    printed = lane.compared.printed
    assert isinstance(printed, Share)
    name = lane.label if len(lane.label) <= LETTERS else lane.label[: LETTERS - 1] + "…"
    parts = [f'<text class="lane" x="{LABEL - 8:.0f}" y="{y + 3.5:.1f}">{escaped(name)}</text>']
    found = lane.compared.prediction
    message = f"{lane.label}: paper {printed.bad} of {printed.runs}"
    color = OUTSIDE
    if found is not None:
        color = INSIDE if found.inside else OUTSIDE
        low, high = (_x(100 * v / printed.runs) for v in (found.low, found.high))
        middle = _x(100 * found.expected / printed.runs)
        message += f", predicted {found.low:.0f} to {found.high:.0f}"
        parts.append(
            f'<rect class="reach" x="{low - 1.5:.1f}" y="{y - 4:.1f}" width="{high - low + 3:.1f}" '
            f'height="8" rx="2"/><line class="middle" x1="{middle:.1f}" x2="{middle:.1f}" '
            f'y1="{y - 4:.1f}" y2="{y + 4:.1f}"/>'
        )
    mark = f'<circle cx="{_x(100 * printed.value):.1f}" cy="{y:.1f}" r="3.6" fill="{color}"/>'
    return f"<g><title>{escaped(message)}</title>{''.join(parts)}{mark}</g>"


def profile_svg(name: str, item: OpenItem, fit: FitResult) -> str:
    """Draws every point's log-likelihood below the best over its value of one item. Filled: kept;
    small: dropped after few runs."""
    places = _places(name, item, fit)
    deepest = min(DEEPEST, max(10.0, max(_depth(e, fit) for e in fit.points.values())))

    def y(depth: float) -> float:
        return TOP + (PROFILE_HEIGHT - TOP - BOTTOM) * min(depth, deepest) / deepest

    kept = {e.point for e in fit.kept}
    final = max(e.runs for e in fit.points.values())
    marks = "".join(
        f"<g><title>{escaped(e.point.words())}: {-_depth(e, fit):.1f} ({e.runs} runs)</title>"
        f'<circle cx="{places[e.point.named[name]]:.1f}" cy="{y(_depth(e, fit)):.1f}" '
        f'r="{4 if e.runs == final else 2.6}" '
        f'fill="{"#0072B2" if e.point in kept else "#ffffff"}"/></g>'
        for e in reversed(fit.ranked)
    )
    band = (
        f'<rect class="band" x="{LEFT:.0f}" y="{TOP - 6:.0f}" '
        f'width="{PROFILE_WIDTH - LEFT - 8:.0f}" height="{y(fit.within_log) - TOP + 6:.1f}"/>'
    )
    floor = PROFILE_HEIGHT - BOTTOM + 6
    axis = (
        f'<line class="tickline" x1="{LEFT:.0f}" x2="{PROFILE_WIDTH - 8:.0f}" y1="{floor:.0f}" '
        f'y2="{floor:.0f}"/>'
    )
    at_printed = places[item.printed]
    printed = (
        f'<line class="printed" x1="{at_printed:.1f}" x2="{at_printed:.1f}" y1="{TOP - 6:.0f}" '
        f'y2="{floor:.0f}"><title>as printed: {escaped(shown(item.printed))}</title></line>'
    )
    ticks = "".join(
        f'<text class="left" x="{LEFT - 6:.0f}" y="{y(d) + 3.5:.1f}">{-d:.0f}</text>'
        for d in (0, deepest / 2, deepest)
    )
    words = "".join(
        f'<text class="tick" x="{x:.1f}" y="{floor + 13:.0f}">{escaped(text)}</text>'
        for text, x in _ticks(item, places)
    )
    middle = (LEFT + PROFILE_WIDTH) / 2
    label = escaped(f"{name} ({item.set})" if item.set else name)
    return (
        f'<svg class="profile" viewBox="0 0 {PROFILE_WIDTH:.0f} {PROFILE_HEIGHT + 8:.0f}" '
        f'role="img" aria-label="likelihood over {label}">{band}{axis}{printed}{ticks}{words}'
        f'<text class="tick" x="{middle:.0f}" y="{floor + 27:.0f}">{label}</text>{marks}</svg>'
    )


def _depth(evaluated: Evaluated, fit: FitResult) -> float:
    found = fit.best.log_likelihood - evaluated.log_likelihood
    return found if isfinite(found) else DEEPEST


def _places(name: str, item: OpenItem, fit: FitResult) -> dict[object, float]:
    """Maps a value to pixels from the left."""
    left, right = LEFT + 12, PROFILE_WIDTH - 20
    if item.range is None:
        choices = list(dict.fromkeys([*item.choices, item.printed]))
        step = (right - left) / len(choices)
        return {value: left + step * (n + 0.5) for n, value in enumerate(choices)}
    values = [float(e.point.named[name]) for e in fit.points.values()]
    values += [float(item.printed), *map(float, item.range)]
    low, high = min(values), max(values)
    return {v: left + (right - left) * (v - low) / (high - low) for v in values}


def _ticks(item: OpenItem, places: dict[object, float]) -> list[tuple[str, float]]:
    if item.range is not None:
        low, high = map(float, item.range)
        middle = (places[low] + places[high]) / 2
        return [(shown(low), places[low]), (shown((low + high) / 2), middle),
                (shown(high), places[high])]  # fmt: skip
    return [
        (shown(value) if isinstance(value, bool | int | float | str) else "", x)
        for value, x in places.items()
    ]
