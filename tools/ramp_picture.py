#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Draws the picture of README.md and docs/index.md from the runs of experiments/ramp.yaml.

    slambed run ramp
    .venv/bin/python tools/ramp_picture.py results/ramp docs/pictures/ramp.svg

A strip is a run; its color says whether track is lost, and where mapping runs. The strips of a
system are its runs in the order of their seeds, none left out.
"""

import html
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from slambed import Results

WIDTH, LEFT, RIGHT, TOP = 760, 52, 18, 36
STRIP, GAP, HEADING, BETWEEN = 6, 2, 22, 10
LINK_HEIGHT, AXIS = 84, 34
EDGE, BOTH, ROBOT, LOST = "#0072B2", "#56B4E9", "#E69F00", "#D55E00"
INK, FAINT, LINE, CARD = "#1f2328", "#59636e", "#d1d9e0", "#ffffff"
NAMES = {
    EDGE: "mapping on the edge",
    BOTH: "on both",
    ROBOT: "on the robot",
    LOST: "track lost",
}
PLACES = {"OS": EDGE, "SZ": BOTH, "MES": ROBOT}
"""DynNetSLAM's states; in a system without them mapping is on the edge."""
STEP_S = 0.5
"""Of the RTT's curve."""
NS_PER_S = 1e9


@dataclass(frozen=True)
class Scale:
    """Seconds to pixels."""

    end_s: float

    def x(self, t_s: float) -> float:
        """Of a time."""
        return LEFT + (WIDTH - LEFT - RIGHT) * min(max(t_s / self.end_s, 0.0), 1.0)


def text(x: float, y: float, words: str, size: int = 12, **more: str) -> str:
    """A line of text in the ink's color."""
    named = {"fill": INK, **more}
    settings = " ".join(f'{key.replace("_", "-")}="{value}"' for key, value in named.items())
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" {settings}>{html.escape(words)}</text>'
    )


def spans(times: np.ndarray, values: list[str], end_s: float) -> list[tuple[float, float, str]]:
    """Stretches of equal value: each holds until the next one's time."""
    found: list[tuple[float, float, str]] = []
    for number, value in enumerate(values):
        until_s = times[number + 1] if number + 1 < len(values) else end_s
        if found and found[-1][2] == value:
            found[-1] = (found[-1][0], float(until_s), value)
        else:
            found.append((float(times[number]), float(until_s), value))
    return found


def strip(events: pd.DataFrame, y: float, scale: Scale) -> list[str]:
    """One run."""
    t_s = events["t_ns"] / NS_PER_S
    switches = events["type"] == "state_changed"
    places = [(0.0, scale.end_s, "OS")]
    if switches.any():
        places = spans(t_s[switches].to_numpy(), events["to"][switches].tolist(), scale.end_s)
    out = [_bar(begin, end, y, PLACES[place], scale) for begin, end, place in places]
    frames = events["type"] == "frame_tracked"
    states = spans(t_s[frames].to_numpy(), events["state"][frames].tolist(), scale.end_s)
    lost = [(begin, end) for begin, end, state in states if state == "lost"]
    out += [_bar(begin, end, y, LOST, scale) for begin, end in lost]
    for at_s in t_s[events["type"] == "update_applied"]:
        x = scale.x(at_s)
        out.append(f'<path d="M{x:.1f} {y}v{STRIP}" stroke="{CARD}" stroke-width="1.2"/>')
    if lost:
        x, middle = scale.x(lost[0][0]), y + STRIP / 2
        cross = f"M{x - 3:.1f} {middle - 3}l6 6m0 -6l-6 6"
        out.append(f'<path d="{cross}" stroke="{INK}" stroke-width="1.4"/>')
    return out


def _bar(begin_s: float, end_s: float, y: float, color: str, scale: Scale) -> str:
    x = scale.x(begin_s)
    width = max(scale.x(end_s) - x, 0.6)
    return f'<rect x="{x:.1f}" y="{y}" width="{width:.1f}" height="{STRIP}" fill="{color}"/>'


def summary(runs: pd.DataFrame) -> str:
    """What became of a system's runs, in words."""
    lost = runs[runs["track_losses"] > 0]
    if lost.empty:
        return f"tracks to the end in {len(runs)} of {len(runs)} runs"
    least, middle, most = (lost["lost_s"].quantile(q) for q in (0.0, 0.5, 1.0))
    many = f"for {least:.1f} to {most:.1f} s (median {middle:.1f})"
    return f"loses track in {len(lost)} of {len(runs)} runs, {many}"


def link(results: Results, y: float, scale: Scale) -> list[str]:
    """The round trip that was asked for: the same in every run on that link, the slowest one."""
    table = results.link()
    asked = table[table["series"] == "asked_rtt_ms"]
    slowest = asked.loc[asked["value"].idxmax(), "run_key"]
    asked = asked[asked["run_key"] == slowest].sort_values("t_s")
    times_s = np.arange(0.0, scale.end_s + STEP_S, STEP_S)
    values_ms = np.interp(times_s, asked["t_s"], asked["value"])
    top_ms = float(values_ms.max())

    def height(rtt_ms: float) -> float:
        return y + LINK_HEIGHT * (1 - rtt_ms / top_ms)

    points = [f"{scale.x(t):.1f} {height(v):.1f}" for t, v in zip(times_s, values_ms, strict=True)]
    base = y + LINK_HEIGHT
    area = f"M{scale.x(0):.1f} {base}L{'L'.join(points)}L{scale.x(scale.end_s):.1f} {base}z"
    out = [
        f'<path d="{area}" fill="{LINE}" fill-opacity="0.55"/>',
        f'<path d="M{"L".join(points)}" fill="none" stroke="{FAINT}" stroke-width="1.8"/>',
    ]
    for rtt_ms in (0.0, 40.0, top_ms):
        out.append(
            f'<path d="M{LEFT} {height(rtt_ms):.1f}H{WIDTH - RIGHT}" stroke="{LINE}" '
            f'stroke-dasharray="{"none" if rtt_ms == 0 else "3 3"}"/>'
        )
        label = f"{rtt_ms:.0f} ms" if rtt_ms else "0"
        out.append(text(LEFT - 6, height(rtt_ms) + 4, label, 11, text_anchor="end", fill=FAINT))
    return out


def picture(results: Results) -> str:
    """The whole SVG."""
    runs = results.valid_runs
    events = results.events("frame_tracked", "state_changed", "update_applied")
    frames = events[events["type"] == "frame_tracked"]
    scale = Scale(np.round(float(frames["t_ns"].max()) / NS_PER_S))
    parts, y = _legend(), float(TOP)
    for label, of_label in runs.groupby("label", sort=False):
        y += HEADING
        parts.append(text(LEFT, y - 6, str(label), 14, font_weight="600"))
        words = summary(of_label)
        parts.append(text(WIDTH - RIGHT, y - 6, words, 12, text_anchor="end", fill=FAINT))
        for key in of_label.sort_values("repetition")["run_key"]:
            parts += strip(events[events["run_key"] == key], y, scale)
            y += STRIP + GAP
        y += BETWEEN
    y += HEADING
    parts.append(text(LEFT, y - 8, "Round-trip time of the link", 14, font_weight="600"))
    parts += link(results, y, scale)
    y += LINK_HEIGHT
    for t_s in range(0, int(scale.end_s) + 1, 20):
        words = f"{t_s} s"
        parts.append(text(scale.x(t_s), y + 16, words, 11, text_anchor="middle", fill=FAINT))
    height = y + AXIS - 8
    title = html.escape(results.title)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:.0f}" '
        f'width="{WIDTH}" height="{height:.0f}" role="img" aria-label="{title}" '
        'font-family="system-ui, -apple-system, Segoe UI, Helvetica, Arial, sans-serif">\n'
        f"<title>{title}</title>\n"
        f'<rect x="0.5" y="0.5" width="{WIDTH - 1}" height="{height - 1:.0f}" rx="8" '
        f'fill="{CARD}" stroke="{LINE}"/>\n' + "\n".join(parts) + "\n</svg>\n"
    )


def _legend() -> list[str]:
    """Above all: colors, and the two marks."""
    out, x, y = [], float(LEFT), 24.0
    for color, name in NAMES.items():
        out.append(f'<rect x="{x:.1f}" y="{y - 9}" width="10" height="10" fill="{color}"/>')
        out.append(text(x + 15, y, name))
        x += 34 + 6.6 * len(name)
    cross = f"M{x:.1f} {y - 8}l7 7m0 -7l-7 7"
    out.append(f'<path d="{cross}" stroke="{INK}" stroke-width="1.6"/>')
    out.append(text(x + 13, y, "first loss"))
    x += 86
    out.append(f'<rect x="{x:.1f}" y="{y - 9}" width="12" height="10" fill="{EDGE}"/>')
    tick = f"M{x + 6:.1f} {y - 9}v10"
    out.append(f'<path d="{tick}" stroke="{CARD}" stroke-width="1.6"/>')
    out.append(text(x + 17, y, "map update"))
    return out


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("error: ramp_picture.py RESULTS PICTURE")
    Path(sys.argv[2]).write_text(picture(Results(sys.argv[1])), encoding="utf-8")
