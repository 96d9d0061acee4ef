# SPDX-License-Identifier: Apache-2.0
"""Draws where the time of a cell goes: stage times per node, and the parts of a map update
round."""

from collections import defaultdict

import numpy as np
import pandas as pd

from slambed.metrics.events import EventLog
from slambed.metrics.stages import delays, stage_times
from slambed.report.conditions import Condition
from slambed.report.kept_events import with_events
from slambed.report.load import Results
from slambed.report.style import (
    NAME_PT,
    NOTE_PT,
    FigureWriter,
    color,
    figure,
    file_name,
    legend_beneath,
)

RUNS_READ = 5
"""Runs read per system: event logs are large, and this many are enough for stage means."""
HATCHES = ("", "//", "..", "xx", "\\\\", "--", "++")


STAGE_EVENTS = (
    "stage", "keyframe_mapped", "keyframe_created", "frame_tracked", "update_applied", "message",
)  # fmt: skip


def event_log(results: Results, run_key: str) -> EventLog | None:
    """Returns the events of a stored run that stage figures need."""
    return results.events(run_key, STAGE_EVENTS)


def draw_stages(results: Results, condition: Condition, writer: FigureWriter) -> None:
    """Draws the wall time of every stage per unit of work, one bar per system."""
    rows: list[dict[str, object]] = []
    delay_rows: list[dict[str, object]] = []
    for label, runs in condition.systems():
        times: dict[tuple[str, str], list[float]] = defaultdict(list)
        parts: dict[str, list[float]] = defaultdict(list)
        for key in with_events(results, runs, STAGE_EVENTS)["run_key"].head(RUNS_READ):
            log = event_log(results, str(key))
            if log is None:
                continue
            for stage in stage_times(log):
                times[stage.node, stage.name].append(stage.wall_ms_per_unit)
            for name, delay in delays(log).items():
                parts[name].append(delay.mean_ms)
        rows += [
            {
                "label": label,
                "node": node,
                "stage": name,
                "mean_ms": float(np.mean(v)),
                "runs": len(v),
            }
            for (node, name), v in times.items()
        ]
        delay_rows += [
            {"label": label, "part": name, "mean_ms": float(np.mean(v)), "runs": len(v)}
            for name, v in parts.items()
        ]
    if rows:
        _stage_bars(pd.DataFrame(rows), condition, writer)
    if any(row["part"] == "T_Total" for row in delay_rows):
        _delay_bars(pd.DataFrame(delay_rows), condition, writer)


def _stage_bars(table: pd.DataFrame, condition: Condition, writer: FigureWriter) -> None:
    labels = list(dict.fromkeys(table["label"]))
    stages = list(dict.fromkeys(zip(table["node"], table["stage"], strict=True)))
    stages.sort(key=lambda item: (item[0] != "mobile", _place(item[1])))
    with figure(height_in=1.4 + 0.27 * len(stages) * max(1.0, 0.7 * len(labels))) as (made, axes):
        axis = axes[0]
        height = 0.8 / len(labels)
        for row, label in enumerate(labels):
            index = condition.number(label)
            own = table[table["label"] == label].set_index(["node", "stage"])["mean_ms"]
            places = [p for p, key in enumerate(stages) if key in own.index]
            axis.barh(
                [p - 0.4 + height * (row + 0.5) for p in places],
                [float(own[stages[p]]) for p in places],
                height=0.92 * height,
                color=color(index),
                alpha=0.8,
                label=label,
                hatch=HATCHES[index % len(HATCHES)],
                edgecolor="white",
                linewidth=0.3,
            )
        axis.set_yticks(range(len(stages)), [f"{node}: {name}" for node, name in stages])
        axis.tick_params(axis="y", labelsize=NAME_PT)
        axis.set_ylim(len(stages) - 0.4, -0.6)
        axis.grid(axis="y", visible=False)
        axis.set_xlabel("time per frame, keyframe or call [ms]")
        legend_beneath(made, axis)
        title = f"Stage times: {condition.title}"
        axis.set_title(title)
        writer.save(
            made,
            file_name("stages", condition.dataset, condition.profile),
            title,
            "Duration of each stage (live: wall time, virtual: from the device's cost model), "
            f"mean of up to {RUNS_READ} runs per system: per tracked frame (extract, track), per "
            "new keyframe (create_keyframe, serialize), per mapped keyframe (insert to "
            "cull_keyframes), else per call.",
            table,
        )


STAGES = (
    "extract", "track", "create_keyframe", "serialize", "serialize_text",
    "parse", "parse_text", "insert", "cull_points",
    "triangulate", "fuse", "bundle", "cull_keyframes", "prepare_update", "apply_update",
    "insert_keyframes", "update_reference", "update_last_frame", "clean_map", "relocalize",
)  # fmt: skip
"""Stages in the order in which a frame passes them."""


def _place(stage: str) -> int:
    return STAGES.index(stage) if stage in STAGES else len(STAGES)


ORDER = ("T_Track", "T_M->E", "T_RKF", "T_LM", "T_PLMU", "T_E->M", "T_MU")


def _delay_bars(table: pd.DataFrame, condition: Condition, writer: FigureWriter) -> None:
    """Draws the map update round as one stacked bar per system (DynNetSLAM, Table 1)."""
    totals = table[table["part"] == "T_Total"].set_index("label")["mean_ms"]
    labels = [label for label in dict.fromkeys(table["label"]) if label in totals.index]
    table = table[table["label"].isin(labels)]
    with figure(height_in=1.7 + 0.5 * len(labels)) as (made, axes):
        axis = axes[0]
        longest = 1.0
        for place, label in enumerate(labels):
            own = table[table["label"] == label].set_index("part")["mean_ms"]
            left = 0.0
            for index, part in enumerate(ORDER):
                width = float(own.get(part, 0.0))
                axis.barh(
                    place,
                    width,
                    left=left,
                    height=0.5,
                    color=color(index),
                    alpha=0.8,
                    hatch=HATCHES[index],
                    edgecolor="white",
                    linewidth=0.3,
                    label=part if place == 0 else None,
                )
                left += width
            wait = float(own.get("T_Wait", 0.0))
            computed = float(own.get("T_Computed", totals[label]))
            axis.plot(
                [computed] * 2,
                [place - 0.34, place + 0.34],
                color="black",
                linewidth=2,
                label="T_Computed measured" if place == 0 else None,
            )
            axis.annotate(
                f"+ {wait:.0f} ms pacing" if wait >= 1 else "",
                (max(computed, left), place),
                xytext=(5, 0),
                textcoords="offset points",
                va="center",
                fontsize=NOTE_PT,
            )
            longest = max(longest, computed, left)
        axis.set_xlim(0, 1.4 * longest)
        axis.set_yticks(range(len(labels)), labels)
        axis.tick_params(axis="y", labelsize=NAME_PT)
        axis.set_ylim(len(labels) - 0.4, -0.6)
        axis.grid(axis="y", visible=False)
        axis.set_xlabel("mean [ms]")
        legend_beneath(made, axis)
        title = f"Map update round: {condition.title}"
        axis.set_title(title)
        writer.save(
            made,
            file_name("update_delay", condition.dataset, condition.profile),
            title,
            "Means of the parts, and of T_Computed: from capture of the newest covered keyframe "
            "until its update was applied, without the pacing of updates (T_Wait).",
            table,
        )
