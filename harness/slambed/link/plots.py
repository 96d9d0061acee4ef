# SPDX-License-Identifier: Apache-2.0
"""Plots of a profile and of a measured link."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slambed.files.outputs import writing
from slambed.link.profile import Profile
from slambed.link.summary import length_s
from slambed.link.traces import MAHIMAHI_PACKET_BITS

ASKED, APPLIED, MEASURED, TCP = "#555555", "#D55E00", "#0072B2", "#009E73"
SIZE_IN = (8.0, 3.2)
DPI = 150
LINKS_DPI = 80
"""Lower resolution for plots with thousands of points, so that files stay small."""
POINTS = 4000
COLUMNS = 2
ERROR_SPAN_MS = 1.0


def span_s(profile: Profile) -> float:
    """Returns the range to plot, a little more than the length, so that its end is seen."""
    return length_s(profile) * (1.05 if profile.duration != 0 else 1.0)


def plot_profile(profile: Profile, path: Path, until_s: float | None = None) -> None:
    """Plots RTT and one-way delays over run time, and rates below if a rate is a trace."""
    end = until_s or span_s(profile)
    t = np.linspace(0.0, end, POINTS)
    traces = [side.rate.trace for side in (profile.up, profile.down) if side.rate]
    rows = 2 if any(traces) else 1
    figure = Figure(figsize=(SIZE_IN[0], SIZE_IN[1] * rows), layout="constrained")
    axes = figure.subplots(rows, 1, squeeze=False)[:, 0]
    axes[0].plot(t, profile.rtt_series_ms(t), color=MEASURED, label="RTT")
    axes[0].plot(t, profile.up_ms(t), color=APPLIED, lw=1, label="up")
    axes[0].plot(t, profile.down_ms(t), color=TCP, lw=1, ls="--", label="down")
    for gap in profile.gaps:
        for start, stop in gap.within(end):
            axes[0].axvspan(start, stop, color=ASKED, alpha=0.3, lw=0)
    axes[0].set(title=profile.name, ylabel="latency [ms]", ylim=(0, None), xlim=(0, end))
    axes[0].legend(frameon=False, ncols=3)
    if rows == 2:
        _plot_rates(axes[1], profile, end)
    axes[-1].set_xlabel("run time [s]")
    for each in axes:
        each.grid(color="#dddddd")
    with writing(path):
        figure.savefig(path, dpi=DPI)


def _plot_rates(axes: Axes, profile: Profile, end_s: float) -> None:
    for side, name, color in ((profile.up, "up", APPLIED), (profile.down, "down", TCP)):
        if side.rate is None:
            continue
        if side.rate.trace is None:
            axes.axhline(side.rate.mbps or 0.0, color=color, label=name)
            continue
        times_s = np.array(profile.rate_traces[side.rate.trace]) / 1e3
        rounds = int(np.ceil(end_s / times_s[-1]))
        times_s = np.concatenate([times_s + i * times_s[-1] for i in range(rounds)])
        counts, edges = np.histogram(times_s, bins=np.arange(0.0, end_s + 0.5, 0.5))
        mbps = counts * MAHIMAHI_PACKET_BITS / np.diff(edges) / 1e6
        axes.step(edges[:-1], mbps, where="post", color=color, label=name)
    axes.set(ylabel="rate [Mbit/s]", ylim=(0, None), xlim=(0, end_s))
    axes.legend(frameon=False, ncols=2)


def plot_links(links: Mapping[str, pd.DataFrame], path: Path) -> None:
    """Plots commanded, applied and measured RTT of links, two per row, with errors below.

    Each frame is a link log (t_s, series, value) with any of the series; a real network has only
    measured RTTs.
    """
    columns = min(len(links), COLUMNS)
    blocks = -(-len(links) // columns)
    figure = Figure(figsize=(SIZE_IN[0] * columns * 0.75, 4.2 * blocks), layout="constrained")
    axes = figure.subplots(
        2 * blocks, columns, squeeze=False, sharex=True, height_ratios=(3, 1) * blocks
    )
    for place, (name, frame) in enumerate(links.items()):
        row, column = 2 * (place // columns), place % columns
        top, bottom = axes[row][column], axes[row + 1][column]
        _plot_link(top, bottom, frame)
        top.set_title(name)
        if column == 0:
            top.set_ylabel("RTT [ms]")
            bottom.set_ylabel("error [ms]")
        for each in (top, bottom):
            each.grid(color="#dddddd")
    for bottom in axes[-1]:
        bottom.set_xlabel("run time [s]")
    # One legend suffices, where most is drawn.
    max(axes[::2].flat, key=lambda top: len(top.lines)).legend(frameon=False)
    smaller: dict[str, Any] = {}
    if path.suffix.lower() == ".png":  # SVG and PDF take no options of Pillow
        smaller = {"pil_kwargs": {"optimize": True}}
    with writing(path):
        figure.savefig(path, dpi=LINKS_DPI, **smaller)


def _plot_link(top: Axes, bottom: Axes, frame: pd.DataFrame) -> None:
    chosen = frame[frame["t_s"] >= 0]
    series = {str(name): rows.sort_values("t_s") for name, rows in chosen.groupby("series")}
    if (tcp := series.get("tcp_rtt_ms")) is not None:
        top.plot(tcp["t_s"], tcp["value"], color=TCP, lw=1, label="tcpi_rtt")
    if (probe := series.get("probe_rtt_ms")) is not None:
        top.plot(probe["t_s"], probe["value"], ".", color=MEASURED, ms=2.5, label="measured")
    if "applied_up_ms" in series and "applied_down_ms" in series:
        up, down = series["applied_up_ms"], series["applied_down_ms"]
        both = up["value"].to_numpy() + np.interp(up["t_s"], down["t_s"], down["value"])
        top.plot(up["t_s"], both, color=APPLIED, lw=0.8, label="applied")
    if (asked := series.get("asked_rtt_ms")) is not None:
        top.plot(asked["t_s"], asked["value"], color=ASKED, lw=0.8, ls="--", label="asked")
    if (error := series.get("probe_error_ms")) is not None:
        bottom.plot(error["t_s"], error["value"], ".", color=MEASURED, ms=2)
        beyond = int((error["value"].abs() > ERROR_SPAN_MS).sum())
        bottom.set_title(f"{beyond} of {len(error)} beyond", fontsize=7, loc="right", pad=2)
    bottom.set_ylim(-ERROR_SPAN_MS, ERROR_SPAN_MS)
