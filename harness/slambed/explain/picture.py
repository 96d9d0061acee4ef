# SPDX-License-Identifier: Apache-2.0
"""Draws the timeline of a run: stages per worker, messages in flight, states, RTT, losses."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from slambed.explain.run_log import NS_PER_S, RunLog
from slambed.explain.updates import rests
from slambed.metrics.network import series
from slambed.report.style import FAULT_SHADE, fault_color, save_picture

WIDTH_IN, LANE_IN = 13.0, 0.30
LEAST_WIDTH = 0.4
STATE_COLORS = {
    "ok": "#009E73", "lost": "#D55E00", "not_initialized": "#999999",
    "OS": "#0072B2", "SZ": "#E69F00", "MES": "#CC79A7",
}  # fmt: skip
STAGE_COLORS = {
    "extract": "#56B4E9", "track": "#0072B2", "create_keyframe": "#003d66",
    "serialize": "#CC79A7", "serialize_text": "#CC79A7", "parse": "#8a4a70",
    "parse_text": "#8a4a70", "apply_update": "#000000",
    "insert_keyframes": "#000000", "update_reference": "#525252", "update_last_frame": "#969696",
    "clean_map": "#bdbdbd", "relocalize": "#F0E442",
    "prepare_update": "#E69F00", "insert": "#c7e9c0", "cull_points": "#a1d99b",
    "triangulate": "#74c476", "fuse": "#31a354", "bundle": "#006d2c", "cull_keyframes": "#00441b",
    "loop_detect": "#fdae6b", "loop_close": "#e6550d", "global_bundle": "#a63603",
}  # fmt: skip
OTHER_COLOR = "#7f7f7f"
CHANNEL_COLORS = {
    "keyframe": "#0072B2", "map": "#D55E00", "control": "#999999", "frame": "#009E73",
}  # fmt: skip
LINK_CURVES = {"asked_rtt_ms": ("asked", "#999999"), "probe_rtt_ms": ("probed", "#009E73")}
"""Label and color of each series of the link that the RTT row shows."""
SOURCE_COLORS = {"tcp_info": "#D55E00", "echo": "#0072B2"}
LOSS_COLOR = "#D55E00"
REST_COLOR = "#7f7f7f"
STAGED_TICKS = {
    "update_begun": ("updates begun", "#E69F00"),
    "update_ready": ("updates ready", "#009E73"),
}
STATES_HEIGHT, MORE_LANE = 3.2, 0.6
"""Heights in lanes: of states and ticks, and of each further lane for staged updates and
suspensions."""
ORDER = ("camera", "tracking", "map-update", "local-mapping", "receiver", "control", "rtt")
"""Workers from top to bottom; others follow by name."""


@dataclass(frozen=True)
class Window:
    """The shown part of a run, in seconds of run time."""

    begin_s: float
    end_s: float


def draw(run: RunLog, window: Window, path: Path) -> None:
    """Writes the figure; the suffix is its format (png, svg or pdf)."""
    save_picture(lambda: figure_of(run, window), path)


def figure_of(run: RunLog, window: Window) -> Figure:
    """Draws one row of axes each for states and mobile, and for messages, edge and RTT if there is
    something to draw. With stages of the edge there are always all rows."""
    lanes = {node: _workers(run, node) for node in ("mobile", "edge")}
    has_edge = bool(lanes["edge"])
    rows: list[tuple[float, Callable[[Axes], None]]] = [
        (STATES_HEIGHT + MORE_LANE * _more_lanes(run), lambda axes: _states(run, axes)),
        (max(1, len(lanes["mobile"])) + 0.6, lambda a: _stages(run, "mobile", lanes["mobile"], a)),
    ]
    if has_edge or len(run.of("message")):
        rows.append((3.0, lambda axes: _messages(run, axes)))
    if has_edge:
        rows.append((len(lanes["edge"]) + 0.6, lambda a: _stages(run, "edge", lanes["edge"], a)))
    if has_edge or _has_rtt(run):
        rows.append((3.0, lambda axes: _rtt(run, axes, window)))
    heights = [height for height, _ in rows]
    figure, axes = plt.subplots(
        len(rows),
        1,
        sharex=True,
        squeeze=False,
        figsize=(WIDTH_IN, LANE_IN * sum(heights) + 1.6),
        gridspec_kw={"height_ratios": heights},
    )
    for axis, (_, paint) in zip(axes.ravel(), rows, strict=True):
        paint(axis)
        for span in run.faults():
            end_s = run.end_s if span.end_s is None else span.end_s
            color = fault_color(span.fault)
            axis.axvspan(span.begin_s, end_s, color=color, alpha=FAULT_SHADE, linewidth=0)
        for loss_s in run.losses_s():
            axis.axvline(loss_s, color=LOSS_COLOR, linewidth=0.9, linestyle="--")
    axes[0, 0].set_xlim(window.begin_s, window.end_s)
    axes[0, 0].set_title(run.title, loc="left")
    axes[-1, 0].set_xlabel("run time [s]")
    shown = [Patch(color=_color(name), label=name) for name in _stage_names(run, window)]
    for fault in dict.fromkeys(span.fault for span in run.faults()):
        patch = Patch(color=fault_color(fault), alpha=FAULT_SHADE, label=f"fault: {fault}")
        shown.append(patch)
    figure.legend(
        handles=shown,
        loc="outside lower center",
        ncols=8,
    )
    return figure


def _legend(axes: Axes, handles: list[Any] | None = None) -> None:
    """Puts the legend above the axes, where it hides nothing."""
    found = axes.get_legend_handles_labels()[0] if handles is None else handles
    if found:
        axes.legend(
            handles=found, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=8, borderaxespad=0.0
        )


def _workers(run: RunLog, node: str) -> list[str]:
    found = {str(w) for w in run.of("stage", node=node)["worker"].dropna()}
    return sorted(found, key=lambda w: (ORDER.index(w) if w in ORDER else len(ORDER), w))


def _stage_names(run: RunLog, window: Window) -> list[str]:
    stages = run.of("stage")
    inside = stages[stages["t_s"].between(window.begin_s, window.end_s)]
    names = set(inside["name"].dropna())
    known = [name for name in STAGE_COLORS if name in names]
    return known + sorted(names - set(known))


def _color(stage: str) -> str:
    return STAGE_COLORS.get(stage, OTHER_COLOR)


def _stages(run: RunLog, node: str, workers: list[str], axes: Axes) -> None:
    """Draws a box per stage, in the lane of its worker."""
    stages = run.of("stage", node=node)
    for lane, worker in enumerate(workers):
        own = stages[stages["worker"] == worker]
        length_s = own["wall_ms"].to_numpy(np.float64) / 1e3
        start_s = own["t_s"].to_numpy(np.float64) - length_s
        colors = [_color(str(name)) for name in own["name"]]
        axes.broken_barh(
            list(zip(start_s, length_s, strict=True)),
            (lane - 0.4, 0.8),
            facecolors=colors,
            edgecolors=colors,
            linewidth=LEAST_WIDTH,  # keeps stages shorter than a pixel visible
        )
    axes.set_yticks(range(len(workers)), workers)
    axes.set_ylim(max(len(workers), 1) - 0.4, -0.6)
    axes.set_ylabel(node)
    axes.grid(axis="y", visible=False)


def _messages(run: RunLog, axes: Axes) -> None:
    """Draws a line per message from queuing to arrival; dropped messages are an x."""
    messages = run.of("message")
    drop = messages["dropped"] == True if "dropped" in messages else messages["t_s"] < 0  # noqa: E712
    arrived = messages[~drop & messages["received_ns"].notna()]
    for channel, own in arrived.groupby("channel"):
        sent = own["queued_ns"].to_numpy(np.float64) / NS_PER_S
        received = own["received_ns"].to_numpy(np.float64) / NS_PER_S
        up = (own["direction"] == "up").to_numpy()
        ends = np.where(up[:, None], [1.0, 0.0], [0.0, 1.0])
        lines = [[(s, e[0]), (r, e[1])] for s, r, e in zip(sent, received, ends, strict=True)]
        color = CHANNEL_COLORS.get(str(channel), OTHER_COLOR)
        axes.add_collection(LineCollection(lines, colors=color, linewidths=0.9))
        axes.plot([], [], color=color, label=str(channel))
    lost = messages[drop]
    if len(lost):
        height = np.where(lost["direction"] == "up", 0.9, 0.1)
        axes.plot(lost["t_s"], height, "x", color=LOSS_COLOR, label="dropped")
    axes.set_yticks([0, 1], ["edge", "mobile"])
    axes.set_ylim(-0.1, 1.1)
    axes.set_ylabel("messages")
    axes.grid(axis="y", visible=False)
    _legend(axes)


def _more_lanes(run: RunLog) -> int:
    return sum(not run.of(kind).empty for kind in ("suspended", *STAGED_TICKS))


def _states(run: RunLog, axes: Axes) -> None:
    """Draws strips of tracking and offloading state and of suspended updates; ticks for drops,
    keyframes, updates."""
    frames = run.of("frame_tracked")
    labels = ["tracking"]
    _strip(axes, 0, frames["t_s"], frames["state"], run.end_s)
    changes = run.of("state_changed")
    if len(changes):
        labels.append("offloading")
        times = pd.concat([pd.Series([0.0]), changes["t_s"]])
        states = pd.concat([changes["from"].iloc[:1], changes["to"]])
        _strip(axes, 1, times, states, run.end_s)
    if rested := rests(run):
        ends = [run.end_s if rest.end_s is None else rest.end_s for rest in rested]
        bars = [(r.begin_s, end - r.begin_s) for r, end in zip(rested, ends, strict=True)]
        axes.broken_barh(bars, (len(labels) - 0.35, 0.7), facecolors=REST_COLOR)
        labels.append("updates at rest")
    ticks = {
        "dropped frames": (run.of("frame_dropped"), LOSS_COLOR),
        "keyframes created": (run.of("keyframe_created"), "#0072B2"),
        **{name: (run.of(kind), color) for kind, (name, color) in STAGED_TICKS.items()},
        "updates applied": (run.of("update_applied"), "#000000"),
        "declined": (run.of("update_declined", "keyframe_declined"), "#CC79A7"),
    }
    for name, (events, color) in ticks.items():
        if len(events):
            lane = len(labels)
            axes.vlines(events["t_s"], lane - 0.35, lane + 0.35, color=color, linewidth=0.8)
            labels.append(name)
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.grid(axis="y", visible=False)
    names = {*frames["state"], *changes.get("from", []), *changes.get("to", [])}
    handles: list[Any] = [Patch(color=c, label=n) for n, c in STATE_COLORS.items() if n in names]
    if run.losses_s():
        handles.append(Line2D([], [], color=LOSS_COLOR, linestyle="--", label="track lost"))
    _legend(axes, handles)


def _strip(axes: Axes, lane: int, times: pd.Series, states: pd.Series, end_s: float) -> None:
    starts, names = times.to_numpy(np.float64), states.astype(str).to_numpy()
    if not len(starts):
        return
    edges = np.flatnonzero(np.r_[True, names[1:] != names[:-1]])
    stops = np.r_[starts[edges[1:]], end_s]
    for begin, stop, name in zip(starts[edges], stops, names[edges], strict=True):
        color = STATE_COLORS.get(name, OTHER_COLOR)
        axes.broken_barh([(begin, stop - begin)], (lane - 0.35, 0.7), facecolors=color)


def _of_link(run: RunLog, name: str) -> pd.DataFrame:
    return pd.DataFrame() if run.link is None else series(run.link, name)


def _has_rtt(run: RunLog) -> bool:
    """Returns whether the RTT row would show a curve or an outage."""
    curves = [run.of("rtt_sample"), *(_of_link(run, name) for name in LINK_CURVES)]
    return bool(run.outages_s) or any(len(curve) for curve in curves)


def _rtt(run: RunLog, axes: Axes, window: Window) -> None:
    """Draws the RTT as requested, as probed, and as measured by the sockets; and outages."""
    tops: list[float] = []

    def show(curve: pd.DataFrame, key: str, **look: Any) -> None:
        axes.plot(curve["t_s"], curve[key], **look)
        inside = curve.loc[curve["t_s"].between(window.begin_s, window.end_s), key].dropna()
        tops.extend([float(inside.max())] if len(inside) else [])

    for name, (label, color) in LINK_CURVES.items():
        curve = _of_link(run, name)
        if len(curve):
            show(curve, "value", color=color, label=label, linewidth=1.2)
    samples = run.of("rtt_sample")
    for source, own in samples.groupby("source"):
        color = SOURCE_COLORS.get(str(source), OTHER_COLOR)
        show(own, "rtt_ms", label=str(source), color=color, linewidth=0.9)
    for number, (begin_s, end_s) in enumerate(run.outages_s):
        shade = axes.axvspan(begin_s, end_s, color=fault_color("cut"), alpha=FAULT_SHADE, lw=0)
        shade.set_label("" if number else "outage")
    axes.set_ylim(0, max([1.0, *(1.1 * top for top in tops)]))
    axes.set_ylabel("RTT [ms]")
    _legend(axes)
