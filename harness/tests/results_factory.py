# SPDX-License-Identifier: Apache-2.0
"""Synthetic raw run folders and whole experiments, consistent with docs/reference/run-folder.md."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from path_files import write_path
from scipy.spatial.transform import Rotation

from slambed.data.trajectory import Trajectory
from slambed.engines.faults import write_planned
from slambed.metrics.catalog import SUMMARY_KEYS
from slambed.metrics.collect import keep_groundtruth
from slambed.metrics.parquet import to_parquet
from slambed.metrics.run_data import RunData
from slambed.metrics.run_summary import summarize_run
from slambed.records.kept_spec import KeptSpec
from slambed.spec.faults import Fault

ORIGIN_S = 1000.0  # recorded time of frame 0
FPS = 10.0
ID = 1 << 56  # ids have their node in the top byte, so a float cannot hold them


def room_walk(duration_s: float, rate_hz: float = 100.0, origin_s: float = ORIGIN_S) -> Trajectory:
    """A smooth closed walk with a rotating camera."""
    t = np.arange(0.0, duration_s, 1.0 / rate_hz)
    w = 2 * np.pi / 20.0
    positions = np.column_stack([2 * np.cos(w * t), 1.5 * np.sin(w * t), 0.2 * np.sin(3 * w * t)])
    turn = Rotation.from_rotvec(np.column_stack([0.2 * np.sin(w * t), 0 * t, w * t]))
    return Trajectory(origin_s + t, positions, turn.as_quat())


def noisy(truth: Trajectory, noise_m: float, rng: np.random.Generator) -> Trajectory:
    """The estimate of a SLAM system: another reference frame, and noise of this size."""
    turn = Rotation.from_rotvec([0.1, -0.4, 1.0])
    positions = turn.apply(truth.positions_m) + np.array([3.0, -1.0, 0.5])
    positions = positions + rng.normal(0, noise_m / np.sqrt(3), positions.shape)
    wobble = Rotation.from_rotvec(rng.normal(0, 0.002, (len(truth), 3)))
    return Trajectory(truth.stamps_s, positions, (turn * truth.rotations() * wobble).as_quat())


STALLED_FRAME = 30


@dataclass
class RawRun:
    """The events of a synthetic run."""

    duration_s: float = 12.0
    edge: bool = True
    noise_m: float = 0.02
    track_ms: float = 40.0
    mapping_ms: float = 120.0
    cpu_percent: float = 60.0
    peak_rtt_ms: float = 85.0
    base_rtt_ms: float = 0.2
    lost_at_s: tuple[tuple[float, float], ...] = ()
    """Intervals of sequence time without a pose."""
    stall_ms: float = 0.0
    """How long the host stalls the extraction of one frame."""
    faults: tuple[Fault, ...] = ()
    seed: int = 1
    manifest: dict[str, Any] = field(default_factory=dict)


def ramp_ms(t_s: np.ndarray, duration_s: float, peak_ms: float) -> np.ndarray:
    """A ramp up to the peak in the middle and down again."""
    return peak_ms * (1 - np.abs(t_s / (duration_s / 2) - 1)).clip(0)


def write_raw(folder: Path, run: RawRun) -> Path:
    """Writes the raw folder; returns it."""
    rng = np.random.default_rng(run.seed)
    (folder / "mobile").mkdir(parents=True)
    write_path(folder / "groundtruth.txt", room_walk(run.duration_s))
    frames = room_walk(run.duration_s, FPS)
    mobile: list[dict[str, Any]] = []
    edge: list[dict[str, Any]] = []
    mapper = edge if run.edge else mobile
    tracked: list[int] = []
    keyframe = points = update = 0
    previous = "not_initialized"
    for frame, stamp in enumerate(frames.stamps_s):
        seq_s = stamp - ORIGIN_S
        taken_ns = int(seq_s * 1e9)
        common = {"frame": frame, "seq_s": round(seq_s, 6)}
        if rng.random() < 0.02:
            mobile.append({"t_ns": taken_ns, "type": "frame_dropped", **common})
            continue
        lost = any(a <= seq_s < b for a, b in run.lost_at_s)
        state = "lost" if lost else "ok"
        track_ms = float(rng.gamma(16, run.track_ms / 16))
        t_ns = taken_ns + int(track_ms * 1e6)
        extract_ms = 0.4 * track_ms
        stall_ms = run.stall_ms if frame == STALLED_FRAME else 0.0
        mobile += [
            stage(t_ns, "extract", "track", extract_ms + stall_ms, n1=750)
            | {"cpu_ms": 0.9 * extract_ms},
            stage(t_ns, "track", "track", track_ms - extract_ms, n1=200),
        ]
        if state == "ok":
            tracked.append(frame)
        kinds = {
            ("not_initialized", "ok"): "initialized",
            ("ok", "lost"): "track_lost",
            ("lost", "ok"): "relocalized",
        }
        if kind := kinds.get((previous, state)):
            mobile.append({"t_ns": t_ns, "type": kind, **common})
        previous = state
        mobile.append(
            {
                "t_ns": t_ns,
                "type": "frame_tracked",
                **common,
                "state": state,
                "matches": 220,
                "inliers": 180,
                "local_points": 900,
                "track_ms": track_ms,
                "wait_ms": 0.0,
            }
        )
        if state == "ok" and frame % 5 == 0:
            created = {
                "type": "keyframe_created",
                **common,
                "keyframe": ID | keyframe,
                "new_points": 90,
            }
            mobile.append({"t_ns": t_ns, **created, "need": "if_mapper_agrees"})
            one_way_ns = 0
            if run.edge:
                rtt = ramp_ms(np.array([seq_s]), run.duration_s, run.peak_rtt_ms)[0]
                one_way_ns = int((rtt / 2 + 1) * 1e6)
                edge.append(
                    message(t_ns, one_way_ns, "keyframe", "up", "KEYFRAME", 41_000, keyframe)
                )
                parsed_ns = t_ns + one_way_ns
                edge.append(stage(parsed_ns, "parse", "map", 4.0))
            start_ns = t_ns + one_way_ns
            total_ms = float(rng.gamma(20, run.mapping_ms / 20))
            for name, share in (
                ("insert", 0.05), ("cull_points", 0.02), ("triangulate", 0.1),
                ("fuse", 0.25), ("bundle", 0.55), ("cull_keyframes", 0.03),
            ):  # fmt: skip
                mapper.append(stage(start_ns, name, "map", total_ms * share))
            points += 80
            done_ns = start_ns + int(total_ms * 1e6)
            mapper.append(
                {
                    "t_ns": done_ns,
                    "type": "keyframe_mapped",
                    "keyframe": ID | keyframe,
                    "keyframes": keyframe + 1,
                    "points": points,
                }
            )
            if run.edge and keyframe % 2 == 1:
                edge.append(stage(done_ns, "prepare_update", "map", 15.0))
                mobile.append(
                    message(done_ns, one_way_ns, "map", "down", "MAP_UPDATE", 230_000, update)
                )
                applied = done_ns + one_way_ns + 30_000_000
                content = {"update": update, "newest_keyframe": ID | keyframe, "keyframes": 1}
                mobile.append(
                    {
                        "t_ns": applied,
                        "type": "update_applied",
                        **content,
                        "points": 400,
                        "gap_keyframes": 0,
                        **parts_of(taken_ns, done_ns, one_way_ns),
                    }
                )
                update += 1
            keyframe += 1
    write_jsonl(folder / "mobile" / "events.jsonl", sorted(mobile, key=lambda e: e["t_ns"]))
    estimate = noisy(frames.take(np.array(tracked, dtype=np.intp)), run.noise_m, rng)
    write_path(folder / "mobile" / "trajectory.txt", estimate)
    live = noisy(frames.take(np.array(tracked, dtype=np.intp)), 1.5 * run.noise_m, rng)
    write_path(folder / "mobile" / "trajectory_live.txt", live)
    nodes = ["mobile"]
    if run.edge:
        nodes.append("edge")
        (folder / "edge").mkdir()
        write_jsonl(folder / "edge" / "events.jsonl", sorted(edge, key=lambda e: e["t_ns"]))
        write_link(folder, run, rng)
    for node in nodes:
        (folder / node / "node.json").write_text(
            json.dumps({"role": node, "exit_reason": "end of sequence", "stopped": False})
        )
    write_samples(folder, run, nodes, rng)
    write_planned(list(run.faults), run.duration_s, folder)
    manifest = {
        "commit": "0123456789abcdef",
        "dirty": False,
        "kernel": "6.1.0",
        "cpu_model": "Invented CPU",
        "cores": 2,
        "seed": run.seed,
        "started_utc": "2026-01-02T03:04:05Z",
        "outcome": "completed",
        "outcome_reason": None,
        "invalid_reasons": [],
        "limits": {"mobile": {"asked": {"quota_cores": 1.0}, "granted": {"quota_cores": 1.0}}},
        "link": {"base_rtt_ms": run.base_rtt_ms} if run.edge else None,
        "command": "slambed run experiments/invented.yaml",
    } | run.manifest
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


def parts_of(captured_ns: int, mapped_ns: int, one_way_ns: int) -> dict[str, float]:
    """The parts of T_Total: everything except tracking, transfer and integration is local
    mapping."""
    way_ms = one_way_ns / 1e6
    total_ms = (mapped_ns - captured_ns) / 1e6 + way_ms + 30.0
    fixed = {
        "t_track_ms": 40.0, "t_me_ms": way_ms, "t_rkf_ms": 4.0, "t_wait_ms": 0.0, "t_plmu_ms": 15.0,
        "t_em_ms": way_ms, "t_mu_ms": 30.0,
    }  # fmt: skip
    return {**fixed, "t_lm_ms": total_ms - sum(fixed.values()), "t_total_ms": total_ms}


def stage(t_ns: int, name: str, worker: str, wall_ms: float, n1: int = 0) -> dict[str, Any]:
    return {
        "t_ns": t_ns, "type": "stage", "name": name, "worker": worker,
        "wall_ms": wall_ms, "cpu_ms": 0.9 * wall_ms, "n1": n1, "n2": 0,
    }  # fmt: skip


def message(
    t_ns: int, one_way_ns: int, channel: str, direction: str, kind: str, size: int, number: int
) -> dict[str, Any]:
    return {
        "t_ns": t_ns + one_way_ns, "type": "message", "channel": channel, "direction": direction,
        "message": kind, "bytes": size, "sequence": number,
        "queued_ns": t_ns, "sent_ns": t_ns, "received_ns": t_ns + one_way_ns,
    }  # fmt: skip


def write_link(folder: Path, run: RawRun, rng: np.random.Generator) -> None:
    (folder / "link").mkdir()
    rows: list[dict[str, Any]] = []
    for t in np.arange(-0.2, run.duration_s, 0.1):
        asked = float(ramp_ms(np.array([t]), run.duration_s, run.peak_rtt_ms)[0])
        rows.append({"t_s": t, "series": "asked_rtt_ms", "value": asked})
        rows.append({"t_s": t, "series": "applied_up_ms", "value": asked / 2})
        rows.append({"t_s": t, "series": "applied_down_ms", "value": asked / 2})
    for t in np.arange(-0.1, run.duration_s, 0.05):
        out = float(ramp_ms(np.array([t]), run.duration_s, run.peak_rtt_ms)[0])
        back = float(ramp_ms(np.array([t + out / 2e3]), run.duration_s, run.peak_rtt_ms)[0])
        probe = (out + back) / 2 + run.base_rtt_ms + abs(float(rng.normal(0, 0.15)))
        rows.append({"t_s": t, "series": "probe_rtt_ms", "value": probe})
    write_jsonl(folder / "link" / "link.jsonl", rows)


def write_samples(folder: Path, run: RawRun, nodes: list[str], rng: np.random.Generator) -> None:
    rows: list[dict[str, Any]] = []
    used = dict.fromkeys(nodes, 1.0)
    for t in np.arange(-0.3, run.duration_s + 0.5, 0.1):
        for node in nodes:
            percent = run.cpu_percent * float(rng.uniform(0.8, 1.2))
            used[node] += 0.1 * percent / 100
            rows.append(
                {
                    "t_s": t,
                    "node": node,
                    "cpu_s": used[node],
                    "cpu_percent": percent,
                    "memory_mb": 120 + 4 * max(t, 0.0),
                    "throttled_s": 0.01 * max(t, 0.0),
                    "throttled_periods": int(max(t, 0.0)),
                }
            )
    write_jsonl(folder / "samples.jsonl", rows)


def write_jsonl(path: Path, rows: list[dict[str, Any]]) -> None:
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


def spec_of(system: str, variant: str, profile: str | None, repetition: int, **more: Any) -> Any:
    """A RunSpec as JSON."""
    edge = profile is not None and system != "orbslam2"
    label = f"{system}:{variant}" if variant != "default" else system
    return {
        "experiment": "invented",
        "label": label,
        "repetition": repetition,
        "cell": "/".join([label, "room_walk", *([profile] if profile else [])]),
        "system": system,
        "variant": variant,
        "params": {"n_orb": 750},
        "dataset": "room_walk",
        "profile": profile,
        "device_mobile": {"name": "half_core"},
        "device_edge": {"name": "host"} if edge else None,
        "engine": "local",
        "link": {"backend": "relay", "profile": profile} if edge else None,
        "seed": 1 + repetition,
        "tolerances": {"rtt_error_ms_median": 1.0},
    } | more


def write_experiment(root: Path, runs: list[tuple[dict[str, Any], RawRun]]) -> Path:
    """A results folder of synthetic raw runs, created by the real collecting code."""
    experiment = root / "invented"
    (experiment / "runs").mkdir(parents=True)
    raw_root = root / "raw"
    for number, (spec, run) in enumerate(runs):
        key = f"{number:016x}"
        raw = write_raw(raw_root / key, run)
        target = experiment / "runs" / key
        target.mkdir()
        to_parquet(RunData(raw, KeptSpec.of(spec)), target)
        summary = summarize_run(raw, spec) | {"run_key": key}
        (target / "summary.json").write_text(json.dumps(summary))
        manifest = json.loads((raw / "manifest.json").read_text()) | {"spec": spec, "run_key": key}
        (target / "manifest.json").write_text(json.dumps(manifest))
        for name in ("trajectory.txt", "trajectory_live.txt"):
            (target / name).write_bytes((raw / "mobile" / name).read_bytes())
        keep_groundtruth(experiment, spec["dataset"], raw / "groundtruth.txt")
    (experiment / "experiment.json").write_text(
        json.dumps({"id": "invented", "title": "An invented experiment", "runs": len(runs)})
    )
    return experiment


def quickstart_like(root: Path, repetitions: int = 3, duration_s: float = 12.0) -> Path:
    """Two systems, two profiles, some repetitions; static offloading loses track under latency."""
    runs: list[tuple[dict[str, Any], RawRun]] = []
    for repetition in range(repetitions):
        for system, variant in (("orbslam2", "default"), ("edgeslam", "static")):
            for profile in ("none", "ramp_85"):
                edge = system != "orbslam2"
                lost = ((6.0, 7.5),) if edge and profile == "ramp_85" and repetition % 2 else ()
                runs.append(
                    (
                        spec_of(system, variant, profile, repetition),
                        RawRun(
                            duration_s=duration_s,
                            edge=edge,
                            lost_at_s=lost,
                            cpu_percent=35 if edge else 80,
                            noise_m=0.015 if edge else 0.02,
                            peak_rtt_ms=85 if profile == "ramp_85" else 0,
                            seed=100 * repetition + len(runs),
                        ),
                    )
                )
    return write_experiment(root, runs)


def losing(root: Path) -> Path:
    """One system alone, and one with an edge whose runs all lose track at 6 s on a ramp."""
    runs = [
        (spec_of("orbslam2", "default", "none", 0), RawRun(edge=False, peak_rtt_ms=0)),
        *(
            (
                spec_of("edgeslam", "static", "ramp_85", repetition),
                RawRun(lost_at_s=((6.0, 7.5),), seed=repetition + 2),
            )
            for repetition in range(2)
        ),
    ]
    return write_experiment(root, runs)


assert len(SUMMARY_KEYS) == len(set(SUMMARY_KEYS))
