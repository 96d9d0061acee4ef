# SPDX-License-Identifier: Apache-2.0
"""Draws the path of one run: as PNG, and as Rerun recording if rerun-sdk is installed."""

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from slambed.data.trajectory import Floats, Trajectory
from slambed.errors import SlambedError, environment_error
from slambed.metrics.accuracy import Alignment
from slambed.metrics.network import series
from slambed.report.alignment import alignment_of, played
from slambed.report.figures.paths import broken_line, widest_axes
from slambed.report.load import Results, load
from slambed.report.style import COLORS, GROUND_TRUTH, FigureWriter, figure, legend_beneath
from slambed.spec.run_spec import run_name


@dataclass(frozen=True)
class RunView:
    """One run with everything that can be drawn."""

    results: Results
    run_key: str
    row: dict[str, Any]
    estimate: Trajectory | None
    truth: Trajectory | None
    alignment: Alignment | None
    """From the estimate's frame to the ground truth's; None if unknown."""


def view_of(folder: Path) -> RunView:
    """Loads the run of a folder via its experiment."""
    results, run_key = load(folder.parents[1]), folder.name
    rows = results.runs[results.runs["run_key"] == run_key]
    if not len(rows):
        raise SlambedError(
            f"run {run_key} has no readable summary, in {results.folder}, run it again"
        )
    row = {str(k): v for k, v in rows.iloc[0].items()}
    estimate = results.trajectory(run_key)
    truth = results.groundtruth(str(row["dataset"]))
    alignment = None
    if estimate is not None and truth is not None:
        try:
            alignment = alignment_of(estimate, truth, row["ate_alignment"])
            truth = played(truth, [estimate])
        except SlambedError:
            alignment = None  # too few poses to align: drawn in its own frame
    return RunView(results, run_key, row, estimate, truth, alignment)


def write_png(view: RunView, folder: Path) -> Path:
    """Draws trajectory, keyframes and the played ground truth in two projections."""
    if view.estimate is None:
        raise SlambedError(f"run {view.run_key} has no trajectory, nothing to draw")
    estimate = view.alignment.apply_to(view.estimate) if view.alignment else view.estimate
    reference = view.truth if view.truth is not None and view.alignment else estimate
    across, up = widest_axes(reference.positions_m)
    third = 3 - across - up
    keyframes = _keyframe_positions(view, estimate)
    writer = FigureWriter(folder, f"slambed explain {view.run_key}", [])
    with figure(1, 2, height_in=3.6) as (made, axes):
        for axis, (a, b) in zip(axes, ((across, up), (across, third)), strict=True):
            if view.truth is not None and view.alignment is not None:
                axis.plot(
                    *broken_line(view.truth, a, b),
                    color=GROUND_TRUTH,
                    linewidth=2.4,
                    alpha=0.6,
                    label="ground truth",
                )
            axis.plot(
                *broken_line(estimate, a, b), color=COLORS[0], linewidth=1.1, label="estimate"
            )
            if len(keyframes):
                axis.plot(
                    keyframes[:, a],
                    keyframes[:, b],
                    "s",
                    color=COLORS[1],
                    markersize=2.5,
                    label="keyframes created",
                )
            axis.set_aspect("equal", adjustable="datalim")
            axis.set_xlabel(f"{'xyz'[a]} [m]")
            axis.set_ylabel(f"{'xyz'[b]} [m]")
        legend_beneath(made, axes[0])
        made.suptitle(run_name(view.row["cell"], view.row["repetition"]), fontsize=10)
        data = pd.DataFrame(estimate.positions_m, columns=["x_m", "y_m", "z_m"])
        data.insert(0, "stamp_s", estimate.stamps_s)
        writer.save(made, f"view_{view.run_key}", f"Run {view.run_key}", "", data)
    return folder / f"view_{view.run_key}.png"


def _keyframe_positions(view: RunView, estimate: Trajectory) -> Floats:
    """Returns the camera positions at which keyframes were created. Shape: (n, 3)."""
    events = view.results.table(view.run_key, "events")
    origin = recorded_origin_s(view)
    if events is None or origin is None:
        return np.zeros((0, 3))
    times = events.loc[events["type"] == "keyframe_created", "seq_s"].dropna().to_numpy(np.float64)
    nearest = np.searchsorted(estimate.stamps_s, times + origin - 1e-3)
    chosen: Floats = estimate.positions_m[np.clip(nearest, 0, len(estimate) - 1)]
    return chosen


def recorded_origin_s(view: RunView) -> float | None:
    """Returns the recorded time of the first played frame: trajectories use recorded time, events
    count from that frame."""
    events = view.results.table(view.run_key, "events")
    if events is None or view.estimate is None or not len(view.estimate):
        return None
    tracked = events[(events["type"] == "frame_tracked") & (events["state"] == "ok")]
    if not len(tracked):
        return None
    return float(view.estimate.stamps_s[0]) - float(tracked["seq_s"].iloc[0])


def write_rerun(view: RunView, path: Path, sequence: Path | None = None) -> Path:
    """Writes a Rerun recording: paths, state and RTT on one timeline, with images of `sequence` if
    given. Raises SlambedError without rerun-sdk."""
    try:
        sdk: Any = importlib.import_module("rerun")
    except ImportError:
        raise environment_error(
            "rerun is not installed, the recording needs it, run: pip install rerun-sdk"
        ) from None
    recording = sdk.RecordingStream("slambed", recording_id=view.run_key)
    recording.save(str(path))
    with recording:
        _log_run(sdk, view, sequence)
    recording.flush()
    recording.disconnect()
    return path


def _log_run(rr: Any, view: RunView, sequence: Path | None) -> None:
    motion = view.alignment
    if view.truth is not None and motion is not None:
        truth = rr.LineStrips3D([view.truth.positions_m], colors=[[119, 119, 119]])
        rr.log("world/ground_truth", truth, static=True)
    origin_s = recorded_origin_s(view)
    if view.estimate is not None and origin_s is not None:
        _log_path(rr, motion.apply_to(view.estimate) if motion else view.estimate, origin_s)
    _log_series(rr, view)
    if sequence is not None and origin_s is not None:
        _log_images(rr, sequence, origin_s)


def _at(rr: Any, t_s: float) -> None:
    rr.set_time("run", duration=float(t_s))


def _log_path(rr: Any, path: Trajectory, origin_s: float) -> None:
    rr.log("world/path", rr.LineStrips3D([path.positions_m], colors=[[0, 114, 178]]), static=True)
    for i, stamp in enumerate(path.stamps_s):
        _at(rr, stamp - origin_s)
        pose = rr.Transform3D(
            translation=path.positions_m[i],
            quaternion=rr.Quaternion(xyzw=path.quaternions_xyzw[i]),
        )
        rr.log("world/camera", pose)


def _log_series(rr: Any, view: RunView) -> None:
    link = view.results.table(view.run_key, "link")
    for name in ("asked_rtt_ms", "probe_rtt_ms"):
        if link is None:
            break
        for t_s, value in series(link, name).itertuples(index=False):
            _at(rr, t_s)
            rr.log(f"link/{name}", rr.Scalars(float(value)))
    events = view.results.table(view.run_key, "events")
    if events is None:
        return
    chosen = events[events["type"].isin(["state_changed", "track_lost", "relocalized", "reset"])]
    for event in chosen.to_dict("records"):
        _at(rr, event["t_ns"] / 1e9)
        words = f"{event['type']} {event.get('from') or ''} {event.get('to') or ''}".strip()
        rr.log("events", rr.TextLog(words))


def _log_images(rr: Any, sequence: Path, origin_s: float) -> None:
    from slambed.data.prepared import PreparedSequence

    prepared = PreparedSequence.open(sequence)
    size = prepared.info.width * prepared.info.height
    frames = np.memmap(sequence / "frames.bin", np.uint8, "r").reshape(prepared.info.frames, -1)
    times_s = prepared.info.time_origin_s + prepared.index["timestamp_ns"] / 1e9 - origin_s
    for index in np.flatnonzero(times_s >= -1e-3):
        _at(rr, float(times_s[index]))
        gray = frames[index, :size].reshape(prepared.info.height, prepared.info.width)
        rr.log("image", rr.Image(gray).compress(jpeg_quality=70))
