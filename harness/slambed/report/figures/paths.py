# SPDX-License-Identifier: Apache-2.0
"""Draws estimated paths over the ground truth, projected along the axis with the least motion."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError
from slambed.metrics.catalog import metric
from slambed.report.alignment import WORDS, alignment_of, played
from slambed.report.conditions import Condition, typical_run
from slambed.report.load import Results
from slambed.report.style import (
    GROUND_TRUTH,
    FigureWriter,
    color,
    dash,
    figure,
    file_name,
    legend_beneath,
)

MOST_POINTS = 800
GAP_S = 0.5
"""A line has a gap if there is no pose for longer than this, because tracking was lost."""


def draw_paths(results: Results, condition: Condition, writer: FigureWriter) -> None:
    """Draws the median-ATE run of each system, aligned, over the ground truth."""
    truth = results.groundtruth(condition.dataset)
    shown: list[tuple[str, str, Trajectory, float | None]] = []
    kinds: list[str] = []
    for label, runs in condition.systems():
        key = typical_run(runs)
        estimate = results.trajectory(key) if key else None
        if key is None or estimate is None:
            continue
        row = runs[runs["run_key"] == key].iloc[0]
        if truth is not None:
            try:
                kind = row["ate_alignment"]
                estimate = alignment_of(estimate, truth, kind).apply_to(estimate)
                kinds.append("sim3" if kind == "sim3" else "se3")
            except SlambedError as error:
                results.complain(f"{key}: {error}")
        shown.append((label, key, estimate, row["ate_rmse_m"]))
    if not shown:
        return
    if truth is not None:
        truth = played(truth, [path for _, _, path, _ in shown])
    reference = truth if truth is not None and len(truth) > 1 else shown[0][2]
    across, up = widest_axes(reference.positions_m)
    rows: list[pd.DataFrame] = []
    with figure(height_in=4.6) as (made, axes):
        axis = axes[0]
        if truth is not None:
            x, y = broken_line(truth, across, up)
            axis.plot(x, y, color=GROUND_TRUTH, linewidth=2.6, alpha=0.6, label="ground truth")
            rows.append(_data(truth, "ground truth", ""))
        for index, (label, key, path, ate) in enumerate(shown):
            x, y = broken_line(path, across, up)
            name = label
            if ate is not None and ate == ate:
                name += f" (ATE {metric('ate_rmse_m').show(ate)} cm)"
            axis.plot(x, y, color=color(index), linestyle=dash(index), linewidth=1.1, label=name)
            rows.append(_data(path, label, key))
        axis.set_aspect("equal", adjustable="datalim")
        axis.set_xlabel(f"{'xyz'[across]} [m]")
        axis.set_ylabel(f"{'xyz'[up]} [m]")
        axis.set_title(f"Trajectories: {condition.title}")
        legend_beneath(made, axis)
        how = (
            f"aligned to the ground truth ({'; '.join(WORDS[k] for k in dict.fromkeys(kinds))})"
            if truth is not None and kinds
            else "ground truth not available"
        )
        writer.save(
            made,
            file_name("trajectory", condition.dataset, condition.profile),
            f"Trajectories: {condition.title}",
            f"The run with the median ATE of each system, {how}. Gaps: no pose.",
            pd.concat(rows, ignore_index=True),
        )


def widest_axes(positions_m: NDArray[np.float64]) -> tuple[int, int]:
    """Returns the two axes of the largest extent, in order x y z."""
    spread = np.ptp(positions_m, axis=0)
    first, second = sorted(np.argsort(-spread, kind="stable")[:2].tolist())
    return first, second


def broken_line(
    path: Trajectory, across: int, up: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the coordinates with NaN where poses are missing."""
    path = thinned(path)
    # A thinned path has longer steps, so the limit for gaps depends on its median step.
    steps = np.diff(path.stamps_s)
    limit = max(GAP_S, 5 * float(np.median(steps))) if len(steps) else GAP_S
    gaps = np.flatnonzero(steps > limit) + 1
    points = path.positions_m[:, [across, up]]
    broken = np.insert(points, gaps, np.nan, axis=0)
    return broken[:, 0], broken[:, 1]


def thinned(path: Trajectory) -> Trajectory:
    """Reduces a path to at most MOST_POINTS poses; more are not visible."""
    if len(path) <= MOST_POINTS:
        return path
    return path.take(np.linspace(0, len(path) - 1, MOST_POINTS).astype(np.intp))


def _data(path: Trajectory, label: str, run_key: str) -> pd.DataFrame:
    path = thinned(path)
    table = pd.DataFrame(path.positions_m, columns=["x_m", "y_m", "z_m"])
    table.insert(0, "stamp_s", path.stamps_s)
    return table.assign(label=label, run_key=run_key)
