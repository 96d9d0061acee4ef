# SPDX-License-Identifier: Apache-2.0
"""Draws one strip per paper as SVG: how far ours is from every judged number, with the margins."""

from dataclasses import dataclass
from math import isfinite, log, nan

from slambed.papers.beside import Beside, beside
from slambed.papers.codes import named
from slambed.papers.judged import Judged, Mark

COLORS: dict[Mark, str] = {
    "R": "#009E73", "D": "#D55E00", "I": "#F0CE52", "N": "#DCDCDC", "E": "#CDB891", "F": "#CC79A7",
    "S": "#7CC4EE", "P": "#9A9A9A",
}  # fmt: skip
"""Hues of Okabe and Ito where they have one; letters repeat them for grayscale prints."""
JUDGED: tuple[Mark, ...] = ("R", "D", "I")
"""Marks that are drawn in full; others, such as stand-ins, are drawn lighter."""
WIDTH = 640
LABEL = 170
LANE = 20
PER_POINT = 2.5
MOST_HIGH = 70.0
RATIO_END = log(5)
POINTS_END = 1.0
RATIO_TICKS = (0.2, 0.5, 1.0, 2.0, 5.0)
POINT_TICKS = (-1.0, -0.5, 0.0, 0.5, 1.0)


@dataclass(frozen=True)
class Lane:
    """All judged numbers of one metric on one axis."""

    metric: str
    ratio: bool
    rows: list[Judged]

    @property
    def end(self) -> float:
        """Returns the largest effect on the axis; larger ones are drawn at the edge."""
        return RATIO_END if self.ratio else POINTS_END

    @property
    def height(self) -> float:
        """Returns the height in pixels, which grows with the number of points."""
        return min(MOST_HIGH, LANE + PER_POINT * len(self.rows))

    def place(self, effect: float) -> float:
        """Returns the position of an effect in pixels from the left."""
        half = (WIDTH - LABEL - 20) / 2
        return LABEL + half + half * max(-1.0, min(1.0, effect / self.end))


def lanes_of(rows: list[Judged]) -> list[Lane]:
    """Returns one lane per metric, with the numbers whose effect fits a common axis (log ratio, or
    points)."""
    drawn = [(r, place.scale) for r in rows if (place := beside(r)) is not None]
    found = []
    for ratio in (True, False):
        own = [r for r, scale in drawn if (scale == "ratio") == ratio]
        for metric in dict.fromkeys(r.cell.metric for r in own):
            found.append(Lane(metric, ratio, [r for r in own if r.cell.metric == metric]))
    return found


def strip_svg(rows: list[Judged], prefix: str, most: int | None = None) -> str:
    """Returns the SVG; every point links to `<prefix><cell id>`. Empty if nothing can be drawn.
    `most`: only as many metrics, those with the most numbers."""
    lanes = lanes_of(rows)
    largest = sorted(lanes, key=lambda lane: -len(lane.rows))[:most]
    lanes = [lane for lane in lanes if lane in largest]
    if not lanes:
        return ""
    parts: list[str] = []
    top = 0.0
    for ratio in (True, False):
        own = [lane for lane in lanes if lane.ratio == ratio]
        if not own:
            continue
        for lane in own:
            parts.append(_lane(lane, top + lane.height / 2, prefix))
            top += lane.height
        parts.append(_axis(own[0], top))
        top += 30
    return (
        f'<svg class="strip" viewBox="0 0 {WIDTH} {top:.0f}" role="img" '
        f'aria-label="ours against the paper, by metric">{"".join(parts)}</svg>'
    )


def _lane(lane: Lane, middle: float, prefix: str) -> str:
    bound = _bound(lane)
    left, right, half = lane.place(-bound), lane.place(bound), lane.height / 2 - 2
    parts = [
        f'<text class="lane" x="{LABEL - 8}" y="{middle + 3.5:.1f}">{_words(lane.metric)}</text>',
        f'<rect class="band" x="{left:.1f}" y="{middle - half:.1f}" width="{right - left:.1f}" '
        f'height="{2 * half:.1f}"/>'
        if bound == bound
        else "",
        f'<line class="zero" x1="{lane.place(0):.1f}" x2="{lane.place(0):.1f}" '
        f'y1="{middle - half - 2:.1f}" y2="{middle + half + 2:.1f}"/>',
    ]
    for number, row in enumerate(lane.rows):
        verdict = row.verdict
        y = middle - half + 2 * half * (number + 0.5) / len(lane.rows)
        place = beside(row)
        assert place is not None
        light = "" if row.mark in JUDGED else ' class="light"'
        what = f"{named(row.cell, {})}: paper {row.stated}, ours {row.ours}, {place.words}"
        whisker = ""
        if _on_axis(row, place) and isfinite(verdict.low) and isfinite(verdict.high):
            whisker = (
                f'<line class="whisker" x1="{lane.place(verdict.low):.1f}" '
                f'x2="{lane.place(verdict.high):.1f}" y1="{y:.1f}" y2="{y:.1f}" '
                f'stroke="{COLORS[row.mark]}"/>'
            )
        parts.append(
            f'<a href="{prefix}{row.cell.id}"{light}><title>{escaped(what)}</title>{whisker}'
            f'<circle cx="{lane.place(place.effect):.1f}" cy="{y:.1f}" r="3" '
            f'fill="{COLORS[row.mark]}"/></a>'
        )
    return "".join(parts)


def _bound(lane: Lane) -> float:
    """Returns the smallest margin of the lane's judged numbers; NaN if none has one on its axis."""
    bounds = [r.verdict.bound for r in lane.rows if r.mark in JUDGED and _on_axis(r, beside(r))]
    return min(filter(isfinite, bounds), default=nan)


def _on_axis(row: Judged, place: Beside | None) -> bool:
    """Returns whether the verdict's interval and margin are on the axis of the number's place."""
    return place is not None and row.verdict.scale == place.scale


def _axis(lane: Lane, top: float) -> str:
    ticks = (
        [(log(t), f"{t:g} x") for t in RATIO_TICKS]
        if lane.ratio
        else [(t, f"{100 * t:+.0f}" if t else "0") for t in POINT_TICKS]
    )
    words = "ours / paper" if lane.ratio else "ours - paper [points]"
    parts = [
        f'<line class="tickline" x1="{lane.place(v):.1f}" x2="{lane.place(v):.1f}" y1="{top}" '
        f'y2="{top + 4}"/><text class="tick" x="{lane.place(v):.1f}" y="{top + 14}">{t}</text>'
        for v, t in ticks
    ]
    axis = (
        f'<line class="tickline" x1="{lane.place(-lane.end):.1f}" x2="{lane.place(lane.end):.1f}"'
    )
    parts.append(f'{axis} y1="{top}" y2="{top}"/>')
    parts.append(f'<text class="lane" x="{LABEL - 26}" y="{top + 14}">{words}</text>')
    return "".join(parts)


def histogram_svg(bins: tuple[int, ...]) -> str:
    """Draws the quantiles of published numbers in our predictions, in ten bins; flat is right."""
    most = max([*bins, 1])
    bars = "".join(
        f'<rect x="{14 * i + 1}" y="{34 - 30 * n / most:.1f}" width="12" '
        f'height="{30 * n / most:.1f}"><title>{n}</title></rect>'
        for i, n in enumerate(bins)
    )
    return (
        '<svg class="pit" viewBox="0 0 142 48" role="img" aria-label="prediction histogram">'
        f'{bars}<line x1="0" x2="142" y1="34" y2="34"/><text x="0" y="45">below</text>'
        '<text x="142" y="45" text-anchor="end">above our prediction</text></svg>'
    )


def _words(metric: str) -> str:
    text = metric.replace("_", " ")
    return escaped(text if len(text) <= 24 else text[:23] + "…")


def escaped(text: str) -> str:
    """Escapes text for use inside SVG elements."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
