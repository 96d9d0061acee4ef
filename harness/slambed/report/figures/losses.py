# SPDX-License-Identifier: Apache-2.0
"""Draws cumulative track losses over time with the latency profile below (DynNetSLAM, Figs. 9,
12)."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from slambed.metrics.network import series
from slambed.report.cells import text
from slambed.report.conditions import Condition
from slambed.report.load import Results
from slambed.report.style import FigureWriter, color, dash, figure, file_name, legend_beneath


def draw_losses(results: Results, condition: Condition, writer: FigureWriter) -> None:
    """Draws one curve per system: how many runs have lost track at least once by that time."""
    name = file_name("losses", condition.dataset, condition.profile)
    title = f"Track losses over time: {condition.title}"
    if not _any_loss(condition.runs):
        writer.nothing(name, title, _no_loss(condition.runs))
        return
    # The link's log is over the run, which takes longer than the sequence with every frame.
    profile = None if _every_frame(results) else asked_profile(results, condition.runs)
    end_s = _end_s(results, condition.runs)
    rows: list[pd.DataFrame] = []
    with figure(
        2 if profile is not None else 1,
        height_in=4.2 if profile is not None else 3.2,
        sharex=True,
        gridspec_kw={"height_ratios": [2.2, 1]} if profile is not None else None,
    ) as (made, axes):
        for label, runs in condition.systems():
            curve = _curve(runs, end_s)
            _step(axes[0], curve, f"{label} (n = {len(runs)})", condition.number(label))
            rows.append(curve.assign(label=label, runs=len(runs)))
        _finish(axes[0], condition.runs)
        legend_beneath(made, axes[0])
        if profile is not None:
            axes[1].plot(profile["t_s"], profile["value"], color="#444444")
            axes[1].set_ylabel("RTT asked [ms]")
            axes[1].set_ylim(0, max(1.0, 1.08 * float(profile["value"].max())))
        axes[-1].set_xlabel("time in the sequence [s]")
        axes[-1].set_xlim(0, end_s)
        axes[0].set_title(title)
        beneath = " Beneath: the round-trip time asked of the link." if profile is not None else ""
        writer.save(
            made,
            name,
            title,
            "Runs that have lost track at least once by this time, of the valid runs." + beneath,
            pd.concat(rows, ignore_index=True),
        )


def draw_losses_by_profile(
    results: Results, label: str, dataset: str, runs: pd.DataFrame, writer: FigureWriter
) -> None:
    """Draws one curve per profile for one system: how much latency it tolerates (DynNetSLAM, Fig.
    9)."""
    name = file_name("losses_by_profile", dataset, label)
    title = f"Track losses by link profile: {label}, {dataset}"
    if not _any_loss(runs):
        writer.nothing(name, title, _no_loss(runs))
        return
    end_s = _end_s(results, runs)
    rows: list[pd.DataFrame] = []
    with figure(height_in=3.4) as (made, axes):
        for index, (profile, part) in enumerate(runs.groupby("profile", sort=False, dropna=False)):
            curve = _curve(part, end_s)
            link = text(profile) or "no link"
            _step(axes[0], curve, f"{link} (n = {len(part)})", index)
            rows.append(curve.assign(profile=link, runs=len(part)))
        _finish(axes[0], runs)
        legend_beneath(made, axes[0])
        axes[0].set_xlabel("time in the sequence [s]")
        axes[0].set_xlim(0, end_s)
        axes[0].set_title(title)
        writer.save(
            made,
            name,
            title,
            "Runs that have lost track at least once by this time, of the valid runs.",
            pd.concat(rows, ignore_index=True),
        )


def asked_profile(results: Results, runs: pd.DataFrame) -> pd.DataFrame | None:
    """Returns the RTT that the profile requests over playback, from one of the first runs with a
    link."""
    for key in runs.loc[runs["link_backend"].notna(), "run_key"].head(3):
        link = results.table(str(key), "link")
        if link is None:
            continue
        asked = series(link, "asked_rtt_ms")
        asked = asked[asked["t_s"] >= 0]
        if len(asked):
            return asked
    return None


def _curve(runs: pd.DataFrame, end_s: float) -> pd.DataFrame:
    times = np.sort(pd.to_numeric(runs["first_loss_s"]).dropna().to_numpy(np.float64))
    count = np.arange(1, len(times) + 1)
    return pd.DataFrame(
        {
            "t_s": np.concatenate([[0.0], times, [end_s]]),
            "runs_lost": np.concatenate([[0], count, [len(times)]]),
        }
    )


def _step(axis: Axes, curve: pd.DataFrame, label: str, index: int) -> None:
    axis.step(
        curve["t_s"],
        curve["runs_lost"],
        where="post",
        label=label,
        color=color(index),
        linestyle=dash(index),
    )


def _finish(axis: Axes, runs: pd.DataFrame) -> None:
    most = int(runs.groupby("cell").size().max())
    axis.set_ylabel("runs with a track loss")
    axis.set_ylim(-0.03 * most, most * 1.05)
    axis.yaxis.set_major_locator(MaxNLocator(integer=True))


def _any_loss(runs: pd.DataFrame) -> bool:
    return bool(pd.to_numeric(runs["first_loss_s"]).notna().any())


def _no_loss(runs: pd.DataFrame) -> str:
    measured = int(runs["lost"].notna().sum())
    if not measured:
        return "nothing to draw, track losses were not measured"
    return f"nothing to draw, no track loss in {measured} run{'' if measured == 1 else 's'}"


def _every_frame(results: Results) -> bool:
    playback = results.spec.get("playback")
    return isinstance(playback, dict) and playback.get("mode") == "every_frame"


def _end_s(results: Results, runs: pd.DataFrame) -> float:
    """Returns the end of the axis in sequence time: where runs keep its pace the end of the longest
    run, else of the ground truth; not before the last loss."""
    losses = pd.to_numeric(runs["first_loss_s"]).dropna()
    if not _every_frame(results):
        ends = pd.to_numeric(runs["wall_s"]).dropna()
        return float(max([*ends.tail(1000), *losses, 1.0]))
    truth = results.groundtruth(text(runs["dataset"].iloc[0]))
    length_s = float(np.ptp(truth.stamps_s)) if truth is not None and len(truth) else 0.0
    return float(max([*losses, length_s, 1.0]))
