# SPDX-License-Identifier: Apache-2.0
"""Draws the timeline of one run as a small inline SVG: state, RTT, CPU, map updates and faults."""

import html

import numpy as np
import pandas as pd

from slambed.metrics.faults import spans
from slambed.metrics.network import series
from slambed.report.load import Results
from slambed.report.style import FAULT_SHADE, fault_color

WIDTH, HEIGHT = 720, 150
LEFT, RIGHT = 64, 8
STATE_TOP, STATE_HEIGHT = 8, 14
RTT_TOP, RTT_HEIGHT = 30, 44
CPU_TOP, CPU_HEIGHT = 82, 44
MOST_POINTS = 300
STATE_COLORS = {"ok": "#009E73", "lost": "#D55E00", "not_initialized": "#999999"}
BLUE, BLACK = "#0072B2", "#222222"


def timeline_svg(results: Results, run_key: str) -> str | None:
    """Returns the SVG, or None if the run has no readable events."""
    events = results.table(run_key, "events")
    if events is None or events.empty:
        return None
    frames = events[events["type"] == "frame_tracked"]
    end_s = max(1.0, float(events["t_ns"].max()) / 1e9)
    parts = [_faults(results, run_key, end_s), _states(frames, end_s), _marks(events, end_s)]
    link = results.table(run_key, "link")
    if link is not None:
        probe = series(link, "probe_rtt_ms")
        parts.append(_curve(probe, end_s, RTT_TOP, RTT_HEIGHT, "RTT", "ms"))
    samples = results.table(run_key, "samples")
    if samples is not None:
        own = samples[samples["node"] == "mobile"].rename(columns={"cpu_percent": "value"})
        parts.append(_curve(_smoothed(own), end_s, CPU_TOP, CPU_HEIGHT, "mobile CPU", "%"))
    return (
        f'<svg class="timeline" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="time line of run {html.escape(run_key)}">' + "".join(parts) + _axis(end_s)
    ) + "</svg>"


def _x(t_s: float, end_s: float) -> float:
    return LEFT + (WIDTH - LEFT - RIGHT) * min(max(t_s / end_s, 0.0), 1.0)


def _faults(results: Results, run_key: str, end_s: float) -> str:
    """Shades the time of injected faults behind the curves."""
    log = results.events(run_key, ("fault_began", "fault_ended"))
    out: list[str] = []
    for span in spans(log.events if log is not None else []):
        name = f"{span.target}: {span} s"
        x0 = _x(span.begin_s, end_s)
        x1 = _x(end_s if span.end_s is None else span.end_s, end_s)
        out.append(
            f'<rect class="fault" x="{x0:.1f}" y="{STATE_TOP}" width="{max(x1 - x0, 0.8):.1f}" '
            f'height="{CPU_TOP + CPU_HEIGHT - STATE_TOP}" fill="{fault_color(span.fault)}" '
            f'fill-opacity="{FAULT_SHADE}"><title>{html.escape(name)}</title></rect>'
        )
    return "".join(out)


def _states(frames: pd.DataFrame, end_s: float) -> str:
    """Draws the state as a strip, one rectangle per interval of equal state."""
    out = [_label("state", STATE_TOP + STATE_HEIGHT / 2)]
    if not len(frames):
        return out[0]
    begins = frames["t_ns"].to_numpy(np.float64) / 1e9
    states = frames["state"].astype(str).tolist()
    start = 0
    for i in range(1, len(states) + 1):
        if i < len(states) and states[i] == states[start]:
            continue
        stop_s = begins[i] if i < len(states) else begins[-1]
        x0, x1 = _x(begins[start], end_s), _x(stop_s, end_s)
        out.append(
            f'<rect x="{x0:.1f}" y="{STATE_TOP}" width="{max(x1 - x0, 0.8):.1f}" '
            f'height="{STATE_HEIGHT}" fill="{STATE_COLORS.get(states[start], "#cccccc")}">'
            f"<title>{html.escape(states[start])} from {begins[start]:.1f} s</title></rect>"
        )
        start = i
    return "".join(out)


def _marks(events: pd.DataFrame, end_s: float) -> str:
    """Draws ticks under the state strip for applied map updates."""
    applied = events.loc[events["type"] == "update_applied", "t_ns"].to_numpy(np.float64) / 1e9
    return "".join(
        f'<line x1="{_x(t, end_s):.1f}" x2="{_x(t, end_s):.1f}" y1="{STATE_TOP + STATE_HEIGHT}" '
        f'y2="{STATE_TOP + STATE_HEIGHT + 5}" stroke="{BLACK}" stroke-width="0.8">'
        f"<title>map update applied at {t:.1f} s</title></line>"
        for t in applied[:MOST_POINTS]
    )


def _smoothed(samples: pd.DataFrame) -> pd.DataFrame:
    """Returns one mean value per second."""
    own = samples.dropna(subset=["value"])
    means = own.groupby(own["t_s"] // 1)["value"].mean()
    return pd.DataFrame({"t_s": means.index + 0.5, "value": means.to_numpy()})


def _curve(data: pd.DataFrame, end_s: float, top: int, height: int, name: str, unit: str) -> str:
    data = data[(data["t_s"] >= 0) & (data["t_s"] <= end_s)]
    if data.empty:
        return ""
    if len(data) > MOST_POINTS:
        data = data.iloc[np.linspace(0, len(data) - 1, MOST_POINTS).astype(int)]
    most = max(float(data["value"].quantile(0.995)), 1e-9)
    points = " ".join(
        f"{_x(t, end_s):.1f},{top + height - height * min(v / most, 1.0):.1f}"
        for t, v in zip(data["t_s"], data["value"], strict=True)
    )
    return (
        _label(name, top + height / 2)
        + f'<text x="{LEFT - 4}" y="{top + 7}" class="tick">{most:.3g} {unit}</text>'
        + f'<text x="{LEFT - 4}" y="{top + height}" class="tick">0</text>'
        + f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{top + height}" y2="{top + height}" '
        + 'stroke="#cccccc"/>'
        + f'<polyline points="{points}" fill="none" stroke="{BLUE}" stroke-width="1.1"/>'
    )


def _label(text: str, y: float) -> str:
    return f'<text x="2" y="{y + 3:.0f}" class="name">{html.escape(text)}</text>'


def _axis(end_s: float) -> str:
    step = next(s for s in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1e9) if end_s / s <= 10)
    ticks = np.arange(0, end_s, step)
    return "".join(
        f'<text x="{_x(t, end_s):.1f}" y="{HEIGHT - 6}" class="time">{t:g} s</text>' for t in ticks
    )
