# SPDX-License-Identifier: Apache-2.0
"""Draws estimated paths over the ground truth, projected along the axis with the least motion."""

import textwrap
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
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
MOST_DOTS = 300
"""Most poses that are drawn as dots of the color of their error."""
ERROR_COLORS = ListedColormap(colormaps["magma_r"](np.linspace(0.2, 0.95, 128)))
"""From light to dark, so that a print in gray shows the same; without the part that is too pale."""
ERROR_NAME = "error [cm]"
CLEAR_SHARE = 0.99
"""The scale of colors ends at this quantile of all errors, so that one jump does not hide the
rest."""
WRAPPED_AT = 30
GAP_S = 0.5
"""A line has a gap if there is no pose for longer than this, because tracking was lost."""


@dataclass(frozen=True)
class DrawnPath:
    """The path of the run that stands for a system, aligned if there is a ground truth."""

    label: str
    run_key: str
    estimate: Trajectory
    ate_m: float | None
    errors_m: NDArray[np.float64] | None
    """Distance of each pose from the ground truth; NaN where that has no pose."""

    @property
    def name(self) -> str:
        """Returns the label, with the error if it is known."""
        if self.ate_m is None or self.ate_m != self.ate_m:
            return self.label
        return f"{self.label} (ATE {metric('ate_rmse_m').show(self.ate_m)} cm)"


def draw_paths(results: Results, condition: Condition, writer: FigureWriter) -> None:
    """Draws the median-ATE run of each system over the ground truth: a panel each, colored by the
    error; without ground truth all in one."""
    truth = results.groundtruth(condition.dataset)
    kinds: list[str] = []
    shown = [
        path
        for label, runs in condition.systems()
        if (path := _path(results, label, runs, truth, kinds)) is not None
    ]
    if not shown:
        return
    if truth is not None:
        truth = played(truth, [path.estimate for path in shown])
    reference = truth if truth is not None and len(truth) > 1 else shown[0].estimate
    axes_shown = widest_axes(reference.positions_m)
    title = f"Trajectories: {condition.title}"
    rows = [_data(path.estimate, path.label, path.run_key) for path in shown]
    if truth is not None:
        rows.insert(0, _data(truth, "ground truth", ""))
    by_error = truth is not None and any(path.errors_m is not None for path in shown)
    panels = len(shown) if by_error else 1
    columns = min(2, panels)
    lines = -(-panels // columns)
    with figure(
        lines,
        columns,
        height_in=4.6 if panels == 1 else 0.7 + 2.9 * lines,
        sharex=True,
        sharey=True,
    ) as (made, axes):
        if by_error and truth is not None:
            _panels(made, axes, shown, truth, axes_shown)
        else:
            _together(axes[0], condition, shown, truth, axes_shown)
            legend_beneath(made, axes[0])
        for axis in axes[panels:]:
            axis.remove()
        across, up = ("xyz"[i] for i in axes_shown)
        for index, axis in enumerate(axes[:panels]):
            axis.set_aspect("equal", adjustable="datalim" if panels == 1 else "box")
            if index + columns >= panels:
                axis.set_xlabel(f"{across} [m]")
                axis.tick_params(labelbottom=True)
            if index % columns == 0:
                axis.set_ylabel(f"{up} [m]")
        made.suptitle(title, fontsize=10)
        how = (
            f"aligned to the ground truth ({'; '.join(WORDS[k] for k in dict.fromkeys(kinds))})"
            if truth is not None and kinds
            else "ground truth not available"
        )
        color_is = " Color: distance from the ground truth (gray)." if by_error else ""
        writer.save(
            made,
            file_name("trajectory", condition.dataset, condition.profile),
            title,
            f"The run with the median ATE of each system, {how} (of an even number the worse of "
            f"the two in the middle).{color_is} Gaps: no pose.",
            pd.concat(rows, ignore_index=True),
        )


def _path(
    results: Results, label: str, runs: pd.DataFrame, truth: Trajectory | None, kinds: list[str]
) -> DrawnPath | None:
    """Returns the path of a system's typical run; the kind of its alignment goes to `kinds`."""
    key = typical_run(runs)
    estimate = results.trajectory(key) if key else None
    if key is None or estimate is None:
        return None
    row = runs[runs["run_key"] == key].iloc[0]
    errors_m = None
    if truth is not None:
        try:
            kind = row["ate_alignment"]
            estimate = alignment_of(estimate, truth, kind).apply_to(estimate)
            errors_m = distances_m(estimate, truth)
            kinds.append("sim3" if kind == "sim3" else "se3")
        except SlambedError as error:
            results.complain(f"{key}: {error}")
    return DrawnPath(label, key, estimate, row["ate_rmse_m"], errors_m)


def distances_m(estimate: Trajectory, truth: Trajectory) -> NDArray[np.float64]:
    """Returns the distance of each pose from the ground truth at its time; NaN outside of it."""
    there = np.column_stack(
        [
            np.interp(
                estimate.stamps_s,
                truth.stamps_s,
                truth.positions_m[:, k],
                left=np.nan,
                right=np.nan,
            )
            for k in range(3)
        ]
    )
    found: NDArray[np.float64] = np.linalg.norm(estimate.positions_m - there, axis=1)
    return found


def _panels(
    made: Figure,
    axes: list[Axes],
    shown: list[DrawnPath],
    truth: Trajectory,
    which: tuple[int, int],
) -> None:
    """Draws a panel per system, with one scale of colors."""
    known = [path.errors_m for path in shown if path.errors_m is not None]
    largest_cm = 100 * float(np.nanquantile(np.concatenate(known), CLEAR_SHARE))
    colored = None
    for axis, path in zip(axes, shown, strict=False):
        x, y = broken_line(truth, *which)
        axis.plot(x, y, color=GROUND_TRUTH, linewidth=3.0, alpha=0.35, label="ground truth")
        axis.set_title(textwrap.fill(path.name, WRAPPED_AT), fontsize=9)
        if path.errors_m is None:
            axis.plot(*broken_line(path.estimate, *which), color=color(0), label=path.label)
            continue
        some = np.arange(len(path.estimate))
        if len(some) > MOST_DOTS:
            some = np.linspace(0, len(some) - 1, MOST_DOTS).astype(np.intp)
        positions_m = path.estimate.positions_m[some]
        colored = axis.scatter(
            positions_m[:, which[0]], positions_m[:, which[1]], c=100 * path.errors_m[some],
            cmap=ERROR_COLORS, vmin=0, vmax=max(largest_cm, 1e-6), s=5, label=path.label,
            zorder=3,
        )  # fmt: skip
        # The script of the page shows it under the pointer.
        colored.set_gid(ERROR_NAME)
    if colored is not None:
        made.colorbar(colored, ax=axes[: len(shown)], label=ERROR_NAME, shrink=0.8, extend="max")


def _together(
    axis: Axes,
    condition: Condition,
    shown: list[DrawnPath],
    truth: Trajectory | None,
    which: tuple[int, int],
) -> None:
    """Draws all systems over each other, where no error is known."""
    if truth is not None:
        x, y = broken_line(truth, *which)
        axis.plot(x, y, color=GROUND_TRUTH, linewidth=2.6, alpha=0.6, label="ground truth")
    for path in shown:
        index = condition.number(path.label)
        x, y = broken_line(path.estimate, *which)
        look = {"color": color(index), "linestyle": dash(index)}
        axis.plot(x, y, linewidth=1.1, label=path.name, **look)


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
