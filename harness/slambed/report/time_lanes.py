# SPDX-License-Identifier: Apache-2.0
"""Draws lanes over run time as inline SVG, from top to bottom: states, curves, marks, one axis.

Times are percentages of the width, so that text and marks keep their size on any screen. Marks
have a tooltip and a link; `scripts/lanes_zoom.js` adds values under the pointer and a closer look.
"""

import html
from collections.abc import Iterable

import numpy as np
import pandas as pd

from slambed.metrics.events import Event
from slambed.metrics.faults import spans
from slambed.report.style import FAULT_SHADE, fault_color

STATE_COLORS = {"ok": "#009E73", "lost": "#D55E00", "not_initialized": "#999999"}
BLUE, BLACK, ORANGE, PINK = "#0072B2", "#222222", "#D55E00", "#CC79A7"
MOST_POINTS = 300
MOST_MARKS = 200
MOST_DOTS = 75
"""Fewer than points of a curve, so that dots stay apart on a narrow screen."""
NAME_HEIGHT, AXIS_HEIGHT = 16, 20
_CROSS = '<path d="M-4,-4L4,4M-4,4L4,-4" stroke="{color}" stroke-width="{width}"/>'
LOSS = _CROSS.format(color="#ffffff", width=5) + _CROSS.format(color="#8c1500", width=2.5)
"""A cross that shows on every state's color."""
ALONG = 1000
"""Units of a curve's own coordinates over the whole time."""
TICK_STEPS_S = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)
MOST_TICKS = 8
"""As many labels as fit on a narrow screen."""


class TimeLanes:
    """An SVG in the making; `y` is where the next lane begins."""

    def __init__(self, end_s: float) -> None:
        self.end_s = max(1.0, end_s)
        self.y = 2
        self._fixed: list[str] = []
        self._moving: list[str] = []

    def svg(self, described: str, name: str = "") -> str:
        """Returns the picture. `described`: for readers who do not see it."""
        bottom = self.y
        ticks = _ticks(self.end_s)
        for t in ticks:
            anchor = "start" if t == 0 else "middle"
            self._moving.append(
                f'<line x1="{self.x(t)}" x2="{self.x(t)}" y1="{bottom}" y2="{bottom + 4}" '
                f'stroke="#999999"/><text x="{self.x(t)}" y="{bottom + 15}" class="time" '
                f'text-anchor="{anchor}">{t:g} s</text>'
            )
        height = bottom + AXIS_HEIGHT
        kind = f"timeline {name}".strip()
        return (
            f'<svg class="{kind}" width="100%" height="{height}" role="group" '
            f'data-end="{self.end_s:g}" aria-label="{html.escape(described)}">'
            f'<svg class="window" width="100%" height="{height}">{"".join(self._moving)}</svg>'
            f"{''.join(self._fixed)}</svg>"
        )

    def x(self, t_s: float) -> str:
        """Returns the place of a time."""
        return f"{100 * min(max(t_s / self.end_s, 0.0), 1.0):.2f}%"

    def name(self, text: str, link: str = "", right: str = "") -> None:
        """Writes a line above the next lane, with a link; `right`: at the other end."""
        shown = html.escape(text)
        y = self.y + NAME_HEIGHT - 5
        words = f'<text x="0" y="{y}" class="name">{shown}</text>'
        self._fixed.append(f'<a href="{html.escape(link)}">{words}</a>' if link else words)
        if right:
            self._fixed.append(f'<text x="100%" y="{y}" class="tick">{html.escape(right)}</text>')
        self.y += NAME_HEIGHT

    def states(self, frames: pd.DataFrame, height: int, link: str = "") -> None:
        """Draws the tracking state as a strip, a rectangle per interval of equal state."""
        begins = frames["t_ns"].to_numpy(np.float64) / 1e9
        states = frames["state"].astype(str).tolist()
        start = 0
        for i in range(1, len(states) + 1):
            if i < len(states) and states[i] == states[start]:
                continue
            stop_s = begins[i] if i < len(states) else begins[-1]
            color = STATE_COLORS.get(states[start], "#cccccc")
            says = f"{states[start].replace('_', ' ')} from {begins[start]:.1f} s"
            self._box(begins[start], stop_s, self.y, height, color, says, link)
            start = i
        self.y += height

    def losses(self, times_s: Iterable[float], height: int, link: str = "") -> None:
        """Draws a cross over the lane above, `height` high, at every track loss."""
        middle = self.y - height / 2
        for t_s in _some(times_s):
            cross = (
                f'<svg x="{self.x(t_s)}" y="{middle:g}" class="at"><rect x="-7" y="-8" width="14" '
                f'height="16" fill="transparent"/>{LOSS}</svg>'
            )
            self._moving.append(_linked(cross, f"track lost at {t_s:.1f} s", link, t_s, True))

    def ticks(
        self, times_s: Iterable[float], height: int, color: str, says: str, link: str
    ) -> None:
        """Draws a tick under the lane above for every event; `y` stays where it is."""
        for t_s in _some(times_s):
            at = self.x(t_s)
            tick = (
                f'<line x1="{at}" x2="{at}" y1="{self.y}" y2="{self.y + height}" '
                f'stroke="{color}" stroke-width="1.6"/>'
            )
            self._moving.append(_linked(tick, f"{says} at {t_s:.1f} s", link, t_s))

    def curve(self, data: pd.DataFrame, height: int, most: float, name: str, unit: str) -> None:
        """Draws a curve from 0 to `most` (columns `t_s`, `value`); `y` stays where it is."""
        shown = _thinned(data, self.end_s)
        points = " ".join(
            f"{ALONG * t / self.end_s:.1f},{height * (1 - min(max(v / most, 0.0), 1.0)):.1f}"
            for t, v in zip(shown["t_s"], shown["value"], strict=True)
        )
        self._moving.append(
            f'<svg y="{self.y}" width="100%" height="{height}" viewBox="0 0 {ALONG} {height}" '
            f'preserveAspectRatio="none"><polyline points="{points}" fill="none" stroke="{BLUE}" '
            f'stroke-width="1.3" vector-effect="non-scaling-stroke" '
            f'data-name="{html.escape(name)}" data-unit="{html.escape(unit)}" '
            f'data-most="{most:.4g}"/></svg>'
        )

    def dots(self, data: pd.DataFrame, height: int, most: float, says: str) -> None:
        """Draws measured values as dots, on the same scale as a curve."""
        shown = _thinned(data, self.end_s, MOST_DOTS)
        for t, v in zip(shown["t_s"], shown["value"], strict=True):
            y = self.y + height * (1 - min(max(v / most, 0.0), 1.0))
            self._moving.append(
                f'<circle cx="{self.x(t)}" cy="{y:.1f}" r="1.6" fill="{ORANGE}">'
                f"<title>{html.escape(says)} {v:.1f} ms at {t:.1f} s</title></circle>"
            )

    def base(self, height: int) -> None:
        """Ends a lane with its line of zero."""
        self.y += height
        self._fixed.append(f'<line x1="0" x2="100%" y1="{self.y}" y2="{self.y}" stroke="#cccccc"/>')

    def gap(self, height: int) -> None:
        """Leaves space."""
        self.y += height

    def faults(self, events: Iterable[Event], top: int, link: str = "") -> None:
        """Shades the time of injected faults from `top` to here."""
        for span in spans(events):
            says = f"{span.target}: {span} s"
            end_s = self.end_s if span.end_s is None else span.end_s
            color = fault_color(span.fault)
            self._box(span.begin_s, end_s, top, self.y - top, color, says, link, "fault")

    def outages(self, spans: Iterable[tuple[float, float]], height: int) -> None:
        """Shades the outages of a link in the lane that begins here."""
        for begin_s, end_s in list(spans)[:MOST_MARKS]:
            says = f"the link's outage {begin_s:g} to {end_s:g} s"
            self._box(begin_s, end_s, self.y, height, fault_color("cut"), says, "", "fault")

    def _box(
        self, begin_s: float, end_s: float, y: int, height: int, color: str, says: str, link: str,
        kind: str = "",
    ) -> None:  # fmt: skip
        width = 100 * max(min(end_s, self.end_s) - begin_s, 0.001 * self.end_s) / self.end_s
        look = f' class="{kind}" fill-opacity="{FAULT_SHADE}"' if kind else ""
        box = (
            f'<rect{look} x="{self.x(begin_s)}" y="{y}" width="{width:.2f}%" height="{height}" '
            f'fill="{color}"/>'
        )
        # A shade lies behind everything, so that no mark on it loses its tooltip and link.
        place = 0 if kind else len(self._moving)
        self._moving.insert(place, _linked(box, says, link, begin_s))


def _linked(shape: str, says: str, link: str, t_s: float, by_key: bool = False) -> str:
    """Returns a shape with its tooltip and its link. Only some marks are stops of the Tab key."""
    tip = f"<title>{html.escape(says)}</title>"
    if not link:
        return f"<g>{tip}{shape}</g>"
    stop = "" if by_key else ' tabindex="-1"'
    # The page of a run begins at the moment; a place on this page has none.
    address = link if link.startswith("#") else f"{link}#t={t_s:.2f}"
    return f'<a href="{html.escape(address)}" data-t="{t_s:.2f}"{stop}>{tip}{shape}</a>'


def _some(times_s: Iterable[float]) -> list[float]:
    return list(times_s)[:MOST_MARKS]


def _thinned(data: pd.DataFrame, end_s: float, most: int = MOST_POINTS) -> pd.DataFrame:
    data = data[(data["t_s"] >= 0) & (data["t_s"] <= end_s)].dropna(subset=["value"])
    if len(data) > most:
        data = data.iloc[np.linspace(0, len(data) - 1, most).astype(int)]
    return data


def _ticks(end_s: float) -> list[float]:
    step = next((s for s in TICK_STEPS_S if end_s / s <= MOST_TICKS), TICK_STEPS_S[-1])
    # A label at the very end would be cut off.
    return [float(t) for t in np.arange(0, end_s * 0.98, step)]
