#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Draws ORB-SLAM3 beside our ORB-SLAM2 on generated sequences, and prints the table.

    slambed run examples/orb_slam3/sequences_beside_ours.yaml
    .venv/bin/python tools/peer_sequences.py results/sequences_beside_ours/summary.csv peer.png

Instead of the summary it also takes a kept table, examples/orb_slam3_on_generated_sequences.csv.
Where a sequence was played several times, the medians are shown.
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import pandas as pd

OURS, PEER = "ours", "ORB-SLAM3"
COLORS = {OURS: "#000000", PEER: "#D55E00"}
MARKS = {OURS: ("o", 46), PEER: ("D", 20)}
"""Mark and its size: one shows behind the other."""
METRICS = ["coverage", "track_losses", "ate_rmse_m", "track_ms_median"]
PREFIX = "synthetic_"


def medians_of(file: Path) -> pd.DataFrame:
    """Returns the median of each metric by sequence and system, in the order of the file."""
    runs = pd.read_csv(file)
    runs = runs[runs.valid.astype(bool)]
    system, sequence = runs.cell.str.split("/").str[0], runs.cell.str.split("/").str[1]
    grouped = runs.groupby([sequence.str.removeprefix(PREFIX), system], sort=False)
    return grouped[METRICS].median()


def table(medians: pd.DataFrame) -> list[str]:
    """Returns the lines of a Markdown table; two numbers are ours and ORB-SLAM3's."""
    lines = [
        "| sequence | frames with a pose [%] | track losses | ATE RMSE [cm] | time, ours = 1 |",
        "|---" * 5 + "|",
    ]
    for sequence, part in medians.groupby(level=0, sort=False):
        both = part.droplevel(0).reindex([OURS, PEER])
        times = both.track_ms_median
        cells = (
            f"`{sequence}`",
            told(both.coverage * 100, ".0f"),
            told(both.track_losses, ".0f"),
            told(both.ate_rmse_m * 100, ".3g"),
            f"{times[PEER] / times[OURS]:.1f}" if times.notna().all() else "none",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def told(values: pd.Series, form: str) -> str:
    return ", ".join("none" if pd.isna(value) else f"{value:{form}}" for value in values)


def draw(medians: pd.DataFrame, target: Path) -> None:
    """Draws errors and frames with a pose, one line for each sequence."""
    sequences = list(dict.fromkeys(medians.index.get_level_values(0)))
    plt.rcParams.update({"font.size": 9})
    figure, axes = plt.subplots(
        1, 2, figsize=(10, 0.27 * len(sequences) + 1.1), sharey=True, layout="constrained"
    )
    for axis, column, title in (
        (axes[0], "ate_rmse_m", "ATE RMSE [cm]"),
        (axes[1], "coverage", "frames with a pose [%]"),
    ):
        for row, sequence in enumerate(sequences):
            own = medians.loc[sequence, column].dropna() * 100
            axis.plot(own, [row] * len(own), color="#bbbbbb", linewidth=1.2, zorder=1)
        for system, color in COLORS.items():
            values = medians[column].xs(system, level=1) * 100
            rows = [sequences.index(name) for name in values.index]
            mark, size = MARKS[system]
            axis.scatter(values, rows, s=size, color=color, marker=mark, label=system)
        axis.set_title(title, loc="left", fontsize=10)
        axis.grid(axis="x", alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_xscale("log")
    axes[0].xaxis.set_major_formatter("{x:g}")
    axes[0].set_yticks(range(len(sequences)), sequences)
    axes[0].invert_yaxis()
    axes[1].set_xlim(0, 103)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
    figure.savefig(target, dpi=100, pil_kwargs={"optimize": True})
    plt.close(figure)


def main() -> int:
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    medians = medians_of(Path(sys.argv[1]))
    draw(medians, Path(sys.argv[2]))
    print("\n".join(table(medians)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
