# SPDX-License-Identifier: Apache-2.0
"""Reports the difficulty of sequences as text, as a table and as a figure."""

from __future__ import annotations

import csv
import io
from dataclasses import asdict
from pathlib import Path

from matplotlib.figure import Figure

from slambed.data.difficulty import LEAST_MATCHES, Difficulty, GapDifficulty
from slambed.files.outputs import writing

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
PANELS: tuple[tuple[str, str], ...] = (
    ("matches", "matches"),
    ("right_per_visible", "right matches per visible point"),
    ("precision", "right share of matches"),
    ("inliers", "inliers of one pose"),
    ("tracked_share", f"pairs with {LEAST_MATCHES} matches"),
    ("flow_px", "median image flow [px]"),
)
SIZE_IN = (11.0, 6.2)


def lines_of(measured: Difficulty) -> list[str]:
    """Returns a heading and one line per gap."""
    depth = (
        f"{measured.depth_share:.2f} with depth, median {measured.median_depth_m:.2f} m"
        if measured.depth_share > 0
        else "no depth"
    )
    return [
        f"{measured.id}: {measured.features:.0f} features a picture, {depth}; "
        f"right by {measured.judge}",
        "  gap [s]  pairs  matches  right/visible  precision  inliers  15 matches  flow [px]",
        *(_line(gap) for gap in measured.gaps),
    ]


def _line(gap: GapDifficulty) -> str:
    return (
        f"  {gap.gap_s:7.1f}  {gap.pairs:5d}  {gap.matches:7.1f}  {gap.right_per_visible:13.3f}  "
        f"{gap.precision:9.3f}  {gap.inliers:7.1f}  {gap.tracked_share:10.2f}  {gap.flow_px:9.1f}"
    )


def csv_of(measured: list[Difficulty]) -> str:
    """Returns one row per sequence and gap; values of the whole sequence are repeated."""
    out = io.StringIO()
    rows = [
        {
            "id": one.id,
            "judge": one.judge,
            "features": one.features,
            "depth_share": one.depth_share,
            "median_depth_m": one.median_depth_m,
            **asdict(gap),
        }
        for one in measured
        for gap in one.gaps
    ]
    writer = csv.DictWriter(out, list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def draw(measured: list[Difficulty], path: Path) -> None:
    """Draws all panels over the gap, with one curve per sequence."""
    figure = Figure(figsize=SIZE_IN, layout="constrained")
    panels = figure.subplots(2, 3).ravel()
    for axes, (key, title) in zip(panels, PANELS, strict=True):
        for i, one in enumerate(measured):
            axes.plot(
                [gap.gap_s for gap in one.gaps],
                [getattr(gap, key) for gap in one.gaps],
                color=COLORS[i % len(COLORS)],
                marker=MARKERS[i % len(MARKERS)],
                markersize=4,
                label=one.id,
            )
        axes.set(title=title, xlabel="gap [s]", ylim=(0, None))
        axes.grid(color="#dddddd")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    with writing(path):
        figure.savefig(path, dpi=120)
