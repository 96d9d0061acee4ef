# SPDX-License-Identifier: Apache-2.0
"""Data of a run's page: its timeline, and the path in space."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from slambed.campaign.recordings import played_frames
from slambed.data.prepared import PreparedSequence
from slambed.data.trajectory import EMPTY, Trajectory, read_tum
from slambed.errors import SlambedError
from slambed.explain.run_log import RunLog, read_run
from slambed.files.json_file import object_or_empty
from slambed.metrics.network import curve, known_rtt
from slambed.metrics.summary import Summary
from slambed.records.manifest import Manifest
from slambed.report.alignment import alignment_of, played
from slambed.serve.features import FeatureFile, map_points
from slambed.serve.thinned import decimated, numbers
from slambed.spec.experiment import Playback

Floats = NDArray[np.float64]
Notify = Callable[[dict[str, Any]], str]

MOST_FRAMES = 20_000
"""Frames under the slider; the page says how many more there are."""
MOST_POSES = 4_000
SAME_TIME_S = 2e-3
"""A frame and its pose are at most so far apart."""
GAP_S = 0.5
"""Longest time without a pose before the path is drawn with a gap."""
SMOOTH_S = 0.5
"""Interval over which CPU use is averaged: samples of 100 ms show quota periods instead of work."""

MARKS: dict[str, tuple[str, Notify]] = {
    "track_lost": ("loss", lambda e: "track lost"),
    "relocalized": ("found", lambda e: "found again"),
    "initialized": ("found", lambda e: "map begun"),
    "reset": ("loss", lambda e: "map given up"),
    "keyframe_created": ("keyframe", lambda e: "keyframe"),
    "update_applied": ("update", lambda e: "map update applied"),
    "update_declined": ("refused", lambda e: f"map update declined: {e.get('reason')}"),
    "loop_closed": ("loop", lambda e: "loop closed"),
    "state_changed": ("state", lambda e: f"state {e.get('from')} to {e.get('to')}"),
    "edge_restarted": ("state", lambda e: "edge restarted"),
    "handover_sent": ("state", lambda e: "map handed over"),
}
"""Events on the timeline: kind of mark, and its text."""


@dataclass(frozen=True)
class RunFiles:
    """The folder of a run, with summary and manifest."""

    folder: Path
    summary: Summary
    manifest: Manifest

    @classmethod
    def of(cls, folder: Path) -> "RunFiles":
        """Reads the files; missing or damaged ones are empty."""
        return cls(
            folder,
            Summary.read(folder / "summary.json") or Summary(),
            Manifest.read(folder / "manifest.json") or Manifest(),
        )


def run_json(
    run: RunFiles,
    truth: Path | None,
    sequence: PreparedSequence | None,
    features: FeatureFile | None,
) -> dict[str, Any]:
    """Returns everything that the page's scripts draw, in seconds of run time and meters; paths and
    map in sequence time. Raises SlambedError if the run has no events."""
    log = read_run(run.folder)
    frames = frames_of(log, run, sequence)
    left_out = len(log.of("frame_tracked", "frame_dropped")) - MOST_FRAMES
    path = _aligned(run, truth)
    zero_s = _origin_s(frames, run, log, sequence) or 0.0
    return {
        "end_s": numbers(max(log.end_s, 0.001)),
        "frames": frames,
        "frames_left_out": max(0, left_out),
        "stretches": _stretches(log),
        "faults": [
            {"begin_s": f.begin_s, "end_s": log.end_s if f.end_s is None else f.end_s,
             "fault": f.fault, "target": f.target}
            for f in log.faults()
        ],
        "marks": _marks(log),
        "series": _series(log),
        "path": {"how": path.how, "estimate": _points(path.estimate, zero_s),
                 "truth": _points(path.truth, zero_s)},
        "map": _map(log, path.estimate, zero_s, sequence, features),
        "has_pictures": sequence is not None,
        "has_features": features is not None,
    }  # fmt: skip


def frames_of(
    log: RunLog, run: RunFiles, sequence: PreparedSequence | None
) -> dict[str, list[Any]]:
    """Returns the first played frames in order of time: index in the sequence, times offered and
    done, state, tracking time and inliers."""
    rows = log.of("frame_tracked", "frame_dropped")
    if rows.empty:
        return _planned_frames(run, sequence)
    took_s = sum(
        rows[name].fillna(0.0).to_numpy(np.float64) / 1e3
        for name in ("track_ms", "wait_ms")
        if name in rows
    )
    dropped = (rows["type"] == "frame_dropped").to_numpy(bool)
    table = pd.DataFrame(
        {
            "index": rows["frame"].to_numpy(np.float64) if "frame" in rows else np.nan,
            "t_s": rows["t_s"].to_numpy(np.float64) - took_s,
            "done_s": rows["t_s"].to_numpy(np.float64),
            "seq_s": rows["seq_s"].to_numpy(np.float64) if "seq_s" in rows else np.nan,
            "state": np.where(dropped, "dropped", _text(rows, "state")),
            "track_ms": rows["track_ms"].to_numpy(np.float64) if "track_ms" in rows else np.nan,
            "inliers": rows["inliers"].to_numpy(np.float64) if "inliers" in rows else np.nan,
        }
    ).sort_values("t_s", kind="stable")
    table = table.head(MOST_FRAMES)
    return {str(name): numbers(table[name].tolist()) for name in table}


def _planned_frames(run: RunFiles, sequence: PreparedSequence | None) -> dict[str, list[Any]]:
    """Returns the frames that playback offers, for a system that reports none."""
    found = np.zeros(0, np.intp)
    times_s = np.zeros(0)
    if sequence is not None:
        found = played_frames(sequence, _playback(run))
        times_s = sequence.times_s[found] - (sequence.times_s[found[0]] if len(found) else 0.0)
    nothing = [None] * len(found)
    return {
        "index": found.tolist(),
        "t_s": numbers(times_s.tolist()), "done_s": numbers(times_s.tolist()),
        "seq_s": numbers(times_s.tolist()), "state": ["unknown"] * len(found),
        "track_ms": nothing, "inliers": nothing,
    }  # fmt: skip


def _playback(run: RunFiles) -> Playback:
    """Returns the playback of run.json; the default if that is missing."""
    content = object_or_empty(run.folder / "nodes" / "run.json").get("playback")
    try:
        return Playback.model_validate(content)
    except ValueError:
        return Playback()


def _text(rows: pd.DataFrame, name: str) -> list[str]:
    return (
        rows[name].fillna("unknown").astype(str).tolist()
        if name in rows
        else ["unknown"] * len(rows)
    )


def _stretches(log: RunLog) -> list[dict[str, Any]]:
    """Returns intervals of equal tracking state."""
    frames = log.of("frame_tracked")
    found: list[dict[str, Any]] = []
    for t_s, state in zip(frames["t_s"], _text(frames, "state"), strict=True):
        if not found or found[-1]["state"] != state:
            if found:
                found[-1]["end_s"] = float(t_s)
            found.append({"begin_s": float(t_s), "end_s": float(t_s), "state": state})
        found[-1]["end_s"] = float(t_s)
    return found


def _marks(log: RunLog) -> list[dict[str, Any]]:
    rows = log.of(*MARKS).to_dict("records")
    marks = []
    for row in rows:
        kind, notify = MARKS[str(row["type"])]
        marks.append(
            {
                "t_s": float(row["t_s"]),
                "kind": kind,
                "says": notify({str(k): v for k, v in row.items()}),
            }
        )
    stalls = log.of("link")
    if len(stalls):
        for row in stalls[stalls["event"].isin(["stalled", "lost", "silent"])].to_dict("records"):
            says = f"{row['channel']} {row['event']} at the {row['node']} node"
            marks.append({"t_s": float(row["t_s"]), "kind": "link", "says": says})
    return sorted(marks, key=lambda mark: mark["t_s"])


def _series(log: RunLog) -> list[dict[str, Any]]:
    """Returns curves over time: lane, name, unit, times and values."""
    found: list[dict[str, Any]] = []

    def add(lane: str, name: str, unit: str, t_s: Floats, values: Floats) -> None:
        inside = (t_s >= 0) & (t_s <= log.end_s) & np.isfinite(values)
        t_s, values = decimated(t_s[inside], values[inside])
        if len(t_s):
            points = {"t_s": numbers(t_s.tolist()), "value": numbers(values.tolist())}
            found.append({"lane": lane, "name": name, "unit": unit, **points})

    if log.link is not None:
        add("RTT", "asked", "ms", *curve(log.link, "asked_rtt_ms"))
        add("RTT", "measured by the probe", "ms", *curve(log.link, "probe_rtt_ms"))
    rtt_samples = log.of("rtt_sample", node="mobile")
    if len(rtt_samples):
        source, chosen = known_rtt(rtt_samples)
        add("RTT", source, "ms", *_columns(chosen, "rtt_ms"))
    frames = log.of("frame_tracked")
    if "track_ms" in frames:
        add("tracking", "tracking step", "ms", *_columns(frames, "track_ms"))
    if len(log.samples):
        for node in ("mobile", "edge"):
            own = log.samples[log.samples["node"] == node].sort_values("t_s")
            smooth = own.assign(
                cpu=own["cpu_percent"]
                .astype(float)
                .groupby(own["t_s"] // SMOOTH_S)
                .transform("mean")
            )
            add("CPU", node, "% of a core", *_columns(smooth, "cpu"))
        own = log.samples[log.samples["node"] == "mobile"].sort_values("t_s")
        throttled = 1e3 * np.diff(own["throttled_s"].to_numpy(np.float64), prepend=np.nan)
        add("throttled", "mobile, per sample", "ms", own["t_s"].to_numpy(np.float64), throttled)
    return found


def _columns(rows: pd.DataFrame, name: str) -> tuple[Floats, Floats]:
    return rows["t_s"].to_numpy(np.float64), rows[name].to_numpy(np.float64)


def _origin_s(
    frames: dict[str, list[Any]], run: RunFiles, log: RunLog, sequence: PreparedSequence | None
) -> float | None:
    """Returns the recorded time of the first played frame: paths use recorded time, events count
    from that frame."""
    estimate = _read(run.folder / "trajectory.txt")
    for seq_s, state in zip(frames["seq_s"], frames["state"], strict=True):
        if state == "ok" and seq_s is not None and len(estimate):
            return float(estimate.stamps_s[0]) - float(seq_s)
    if sequence is not None and frames["index"]:
        first = frames["index"][0]
        return (
            None
            if first is None
            else sequence.info.time_origin_s + float(sequence.times_s[int(first)])
        )
    return float(estimate.stamps_s[0]) if len(estimate) else None


@dataclass(frozen=True)
class _Paths:
    """The estimated path, aligned to the ground truth as for its ATE."""

    how: str
    estimate: Trajectory
    truth: Trajectory


def _aligned(run: RunFiles, truth_file: Path | None) -> _Paths:
    estimate = _read(run.folder / "trajectory.txt")
    truth = _read(truth_file) if truth_file is not None else EMPTY
    how = "no true path is known: the estimate in its own frame"
    if len(estimate) and len(truth):
        try:
            kind = run.summary.get("ate_alignment")
            estimate = alignment_of(estimate, truth, kind).apply_to(estimate)
            truth = played(truth, [estimate])
            how = "aligned by Sim(3), with its scale" if kind == "sim3" else "aligned, no scale"
        except SlambedError as few:
            how, truth = f"not aligned: {few}", EMPTY
    return _Paths(how, estimate, truth)


def _map(
    log: RunLog,
    estimate: Trajectory,
    zero_s: float,
    sequence: PreparedSequence | None,
    features: FeatureFile | None,
) -> dict[str, Any]:
    """Returns the keyframes that have a pose, and the points that they see: coordinates, and how
    many there are after each keyframe."""
    created = log.of("keyframe_created", node="mobile")
    keyframes: list[tuple[int, int]] = []
    times_s: list[float] = []
    if len(estimate) and {"frame", "seq_s"} <= set(created):
        created = created.dropna(subset=["frame", "seq_s"]).sort_values("seq_s", kind="stable")
        for frame, seq_s in zip(created["frame"], created["seq_s"], strict=True):
            pose = int(np.argmin(np.abs(estimate.stamps_s - zero_s - seq_s)))
            if abs(estimate.stamps_s[pose] - zero_s - seq_s) < SAME_TIME_S:
                keyframes.append((int(frame), pose))
                times_s.append(float(seq_s))
    points, ends = np.zeros((0, 3)), [0] * len(keyframes)
    if sequence is not None and features is not None and estimate.has_orientation:
        points, ends = map_points(features, sequence, keyframes, estimate)
    return {
        "t_s": numbers(times_s),
        "keyframes": _columns_of(estimate.positions_m[[pose for _, pose in keyframes]]),
        "points": _columns_of(np.round(points, 3)),
        "ends": ends,
    }


def _columns_of(points: Floats) -> dict[str, list[Any]]:
    return {name: numbers(points[:, axis].tolist()) for axis, name in enumerate("xyz")}


def _read(path: Path) -> Trajectory:
    try:
        return read_tum(path) if path.is_file() else EMPTY
    except SlambedError:
        return EMPTY


def _points(path: Trajectory, zero_s: float) -> dict[str, list[Any]]:
    """Returns times in sequence time, positions, and the poses before which the path has a gap."""
    if len(path) > MOST_POSES:
        path = path.take(np.linspace(0, len(path) - 1, MOST_POSES).astype(np.intp))
    steps = np.diff(path.stamps_s)
    limit = max(GAP_S, 5 * float(np.median(steps))) if len(steps) else GAP_S
    x, y, z = path.positions_m.T
    return {
        "t_s": numbers((path.stamps_s - zero_s).tolist()),
        "x": numbers(x.tolist()), "y": numbers(y.tolist()), "z": numbers(z.tolist()),
        "breaks": (np.flatnonzero(steps > limit) + 1).tolist(),
    }  # fmt: skip
