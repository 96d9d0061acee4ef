#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Draws ORB-SLAM3 beside our systems on ever smaller shares of a core, and prints the table.

    slambed run examples/orb_slam3/orb_slam3_beside_ours.yaml --runs 10
    .venv/bin/python tools/peer_picture.py results/orb_slam3_beside_ours peer.png

Instead of the folder it also takes a table of runs, such as the kept one:

    .venv/bin/python tools/peer_picture.py examples/orb_slam3_at_30_fps.csv peer.png

Dots are runs, lines are medians. Time, CPU and memory are ratios to the median of ours alone on a
whole core with the same sequence. The error of a run that tracked less than 90 % of the frames is
left out, because its path is shorter. Several sequences get a row of panels each, of four metrics.
"""

import sys
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullLocator

from slambed import Results
from slambed.metrics.statistics import interval, wilson

ALONE = "ours alone"
COLORS = {
    "ORB-SLAM3": "#D55E00",
    ALONE: "#000000",
    "Edge-SLAM": "#0072B2",
    "DynNetSLAM": "#009E73",
}
LINKS = {"rtt_20": ("-", "o", "20 ms RTT"), "ramp_0_85_0": ("--", "x", "ramp 0 to 85 ms")}
"""Link -> line, mark and words."""
SHARES = {1.0: "1", 0.5: "1/2", 0.25: "1/4", 0.125: "1/8"}
BESIDE = 0.04
"""Of the distance between two shares: so far from each other are the dots of two systems."""


@dataclass(frozen=True)
class Panel:
    """One metric: column, title, factor to its unit, and whether its axis is logarithmic."""

    column: str
    title: str
    factor: float = 1.0
    log: bool = False


RATIOS = {
    "time": "track_ms_median",
    "cpu": "mobile_cpu_percent_mean",
    "memory": "mobile_mem_mb_peak",
}
"""Column -> the metric of which it is the ratio to ours alone on a whole core."""
PANELS = (
    Panel("coverage", "frames with a pose [%]", 100.0),
    Panel("ate_rmse_m", "ATE RMSE [cm], of runs with 90 % of the frames", 100.0),
    Panel("track_losses", "track losses of a run"),
    Panel("time", "tracking time, ours alone on 1 core = 1", log=True),
    Panel("cpu", "CPU of the robot, likewise", log=True),
    Panel("memory", "peak memory of the robot, likewise", log=True),
)
FEW_PANELS = (PANELS[0], replace(PANELS[1], title="ATE RMSE [cm]"), *PANELS[2:4])
"""Of several sequences, with shorter titles."""


def runs_of(place: Path) -> pd.DataFrame:
    """Returns the valid runs of a results folder or a table, with name, sequence, share of a core
    and ratios."""
    runs = pd.read_csv(place) if place.suffix == ".csv" else Results(place).runs
    runs = runs[runs.valid.astype(bool)].copy()
    label = runs.cell.str.split("/").str[0]
    runs["sequence"] = runs.cell.str.split("/").str[1]
    runs["name"] = label.str.partition(", ")[0]
    runs["share"] = label.str.extract(r", ([0-9.]+) core", expand=False).astype(float)
    whole = runs[(runs.name == ALONE) & (runs.share == 1.0)].groupby("sequence")
    for column, of in RATIOS.items():
        runs[column] = runs[of] / runs.sequence.map(whole[of].median())
    runs.loc[runs.failed.astype(bool), "ate_rmse_m"] = float("nan")
    return runs


def draw(runs: pd.DataFrame, target: Path) -> None:
    """Draws one panel for each metric, or a row of panels for each of several sequences."""
    plt.rcParams.update({"font.size": 9})
    sequences = sequences_of(runs)
    if len(sequences) == 1:
        figure, axes = plt.subplots(2, 3, figsize=(13, 6), layout="constrained")
        for axis, panel in zip(axes.flat, PANELS, strict=True):
            draw_panel(axis, panel, runs)
    else:
        size = (13, 2.4 * len(sequences))
        figure, axes = plt.subplots(
            len(sequences), len(FEW_PANELS), figsize=size, layout="constrained"
        )
        for row, sequence in zip(axes, sequences, strict=True):
            for axis, panel in zip(row, FEW_PANELS, strict=True):
                draw_panel(axis, panel, runs[runs.sequence == sequence])
            row[0].set_ylabel(sequence.removeprefix("synthetic_"))
    names, links = runs.name.unique(), runs.profile.unique()
    lines = [plt.Line2D([], [], color=c, label=n) for n, c in COLORS.items() if n in names]
    lines += [
        plt.Line2D([], [], color="gray", linestyle=line, marker=mark, label=words)
        for link, (line, mark, words) in LINKS.items()
        if link in links and len(links) > 1
    ]
    figure.legend(handles=lines, loc="outside lower center", ncols=6, frameon=False)
    figure.savefig(target, dpi=100, pil_kwargs={"optimize": True})


def sequences_of(runs: pd.DataFrame) -> list[str]:
    """Returns the sequences in the order of the runs."""
    return list(dict.fromkeys(runs.sequence))


def draw_panel(axis: Axes, panel: Panel, runs: pd.DataFrame) -> None:
    """Draws one metric of all systems, over the shares of a core that were played."""
    order = [share for share in SHARES if (runs.share == share).any()]
    for number, (name, color) in enumerate(COLORS.items()):
        for link, (line, mark, _) in LINKS.items():
            own = runs[(runs.name == name) & (runs.profile == link)]
            own = own.dropna(subset=[panel.column])
            if own.empty:
                continue
            beside = (number - 1.5) * BESIDE
            x = own.share.map(order.index) + beside
            y = own[panel.column] * panel.factor
            axis.plot(x, y, mark, color=color, markersize=3, alpha=0.5)
            medians = y.groupby(x).median()
            axis.plot(medians.index, medians, line, color=color, linewidth=1.5)
    axis.set_title(panel.title, loc="left", fontsize=10)
    axis.set_xticks(range(len(order)), [f"{SHARES[share]} core" for share in order])
    if panel.log:
        axis.set_yscale("log")
        axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_locator(NullLocator())
    else:
        # An axis of nothing but zeros would show thousandths.
        most = runs[panel.column].max() * panel.factor
        axis.set_ylim(bottom=0, top=None if most > 0 else 1)
    axis.grid(axis="y", alpha=0.3)
    axis.spines[["top", "right"]].set_visible(False)


def told(values: pd.Series, digits: int) -> str:
    """A median with its 95 % interval; a range in parentheses below six runs."""
    values = values.dropna()
    if values.empty:
        return "none"
    found = interval(values.to_numpy())
    first, last = "()" if found.is_range else "[]"
    return (
        f"{found.value:.{digits}f} {first}{found.low:.{digits}f} to {found.high:.{digits}f}{last}"
    )


def table(runs: pd.DataFrame) -> list[str]:
    """Returns the lines of a Markdown table, a row for each combination."""
    sequences = sequences_of(runs)
    several = len(sequences) > 1
    lines = [
        ("| sequence " if several else "")
        + "| core | system | link | runs | frames with a pose [%] | ATE RMSE [cm] "
        "| runs with a loss [%] | frames dropped | time | CPU | memory |",
        "|---" * (11 + several) + "|",
    ]
    for sequence, (share, words), name in product(sequences, SHARES.items(), COLORS):
        for link, (*_, says) in LINKS.items():
            own = runs[
                (runs.sequence == sequence)
                & (runs.name == name)
                & (runs.profile == link)
                & (runs.share == share)
            ]
            if own.empty:
                continue
            lost = wilson(int((own.track_losses > 0).sum()), len(own))
            cells = (
                *([f"`{sequence.removeprefix('synthetic_')}`"] if several else []),
                words,
                name,
                says if name in ("Edge-SLAM", "DynNetSLAM") else "",
                str(len(own)),
                told(own.coverage * 100, 0),
                told(own.ate_rmse_m * 100, 2),
                f"{lost.value * 100:.0f} [{lost.low * 100:.0f} to {lost.high * 100:.0f}]",
                told(own.frames_dropped, 0),
                *(told(own[column], 2) for column in RATIOS),
            )
            lines.append(f"| {' | '.join(cells)} |")
    return lines


def main() -> int:
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    runs = runs_of(Path(sys.argv[1]))
    draw(runs, Path(sys.argv[2]))
    print("\n".join(table(runs)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
