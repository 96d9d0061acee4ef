# SPDX-License-Identifier: Apache-2.0
"""One run's raw folder into its flat summary (docs/formats.md, `summary.json`)."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from slambed.data.prepared import SEQUENCE_FILE
from slambed.errors import SlambedError
from slambed.metrics.accuracy import absolute_error, relative_error
from slambed.metrics.collect import read_link, read_samples
from slambed.metrics.events import EventLog, read_events
from slambed.metrics.faults import told
from slambed.metrics.network import RttProof, bytes_moved, rtt_proof, series
from slambed.metrics.offloading import offloading_summary
from slambed.metrics.resources import NOTHING, Resources, resources_of
from slambed.metrics.stages import host_stall_ms_max, mapping_ms_per_keyframe, total_ms
from slambed.metrics.tracking import mean_of, quantile_of, tracking_of, values_of
from slambed.metrics.trajectory import EMPTY, Trajectory, read_tum
from slambed.metrics.update_round import CLOSURE_LIMIT_MS, round_summary
from slambed.spec.device import VIRTUAL

RPE_DELTA_S = 1.0

SUMMARY_KEYS = (
    "run_key", "experiment", "cell", "repetition",
    "system", "variant", "dataset", "profile", "device_mobile", "device_edge",
    "engine", "link_backend", "seed",
    "outcome", "valid", "invalid_reason", "faults",
    "frames_total", "frames_tracked", "frames_dropped", "coverage",
    "track_losses", "lost", "first_loss_s", "relocalisations", "reloc_s_max", "resets",
    "loops_closed",
    "keyframes", "map_points",
    "ate_rmse_m", "ate_pairs", "ate_alignment", "ate_scale", "ate_live_rmse_m",
    "rpe_trans_m", "rpe_rot_deg",
    "track_ms_median", "track_ms_mean", "track_ms_p95", "extract_ms_median",
    "local_mapping_ms_mean", "local_mapping_cpu_ms_mean",
    "mobile_cpu_percent_mean", "edge_cpu_percent_mean",
    "mobile_mem_mb_peak", "edge_mem_mb_peak",
    "bytes_up", "bytes_down", "updates_applied", "update_delay_ms_median",
    "update_gap_keyframes_mean", "update_parts_error_ms_max",
    "keyframe_bytes_median", "update_bytes_median", "serialise_ms_median", "parse_ms_median",
    "state_switches", "state_os_s", "state_sz_s", "state_mes_s", "updates_stale",
    "rtt_asked_ms_mean", "rtt_measured_ms_mean", "rtt_error_ms_median", "rtt_error_ms_p99",
    "throttled_ms", "throttled_share", "host_stall_ms_max", "wall_s",
)  # fmt: skip
"""The columns of summary.csv in their order."""


def summarise_run(
    raw_dir: Path, spec: Mapping[str, Any], groundtruth: Path | None = None
) -> dict[str, Any]:
    """The summary of one raw folder; what could not be measured is None.

    `spec` is the RunSpec as JSON; `manifest.json` of the folder says how the run ended. The true
    path is `groundtruth`, else `groundtruth.txt` of the folder, else that of the sequence in
    `run.json`.
    """
    summary, _ = summarise_with_problems(raw_dir, spec, groundtruth)
    return summary


def summarise_with_problems(
    raw_dir: Path, spec: Mapping[str, Any], groundtruth: Path | None = None
) -> tuple[dict[str, Any], list[str]]:
    """As `summarise_run`, with what was wrong with the raw files (one line each)."""
    problems: list[str] = []
    manifest = _read_json(raw_dir / "manifest.json", problems)
    log = read_events(raw_dir)
    samples, complaints = read_samples(raw_dir)
    link, link_complaints = read_link(raw_dir)
    problems += [*log.problems, *complaints, *link_complaints]
    # Without a frame (mobile died early) the window is what the samples cover.
    end_s = playback_end_s(log)
    tracking = tracking_of(log)
    mobile = resources_of(samples, "mobile", end_s)
    has_edge = spec.get("device_edge") is not None
    edge = resources_of(samples, "edge", end_s) if has_edge else NOTHING
    proof = _told_proof(manifest)
    if proof is None and link is not None:
        proof = rtt_proof(link, _base_rtt_ms(manifest), end_s)
    measured = len(log.events) > 0
    summary: dict[str, Any] = dict.fromkeys(SUMMARY_KEYS)
    summary |= _identity(spec, manifest)
    summary["faults"] = told(log.of("fault_began", "fault_ended"))
    if measured:
        summary |= {
            "frames_total": tracking.frames_total,
            "frames_tracked": tracking.frames_tracked,
            "frames_dropped": tracking.frames_dropped,
            "coverage": tracking.coverage,
            "track_losses": tracking.track_losses,
            "lost": tracking.track_losses > 0,
            "first_loss_s": tracking.first_loss_s,
            "relocalisations": tracking.relocalisations,
            "reloc_s_max": tracking.reloc_s_max,
            "resets": tracking.resets,
            "loops_closed": len(log.of("loop_closed")),
        }
    summary |= _map_size(log)
    summary |= _accuracy(raw_dir, _find_groundtruth(raw_dir, groundtruth), problems)
    summary |= _times(log)
    summary |= _resources(mobile, edge)
    summary |= _network(log, proof, has_edge)
    if (summary["update_parts_error_ms_max"] or 0.0) > CLOSURE_LIMIT_MS:
        problems.append("update_applied: the parts of T_Total do not add up to it")
    summary |= offloading_summary(log, end_s)
    if not is_virtual(spec):
        summary["host_stall_ms_max"] = host_stall_ms_max(log)
    elif link is not None:
        summary["rtt_asked_ms_mean"] = _asked_mean(link, end_s)
    summary["wall_s"] = end_s
    outcome, reason = _verdict(spec, manifest, summary)
    summary |= {"outcome": outcome, "valid": reason is None, "invalid_reason": reason}
    return summary, problems


def playback_end_s(log: EventLog) -> float | None:
    """Run time of the last frame event: the end of playback."""
    frames = log.of("frame_tracked", "frame_dropped")
    return frames[-1]["t_ns"] / 1e9 if frames else None


def _identity(spec: Mapping[str, Any], manifest: Mapping[str, Any]) -> dict[str, Any]:
    link = spec.get("link") or {}
    return {
        "run_key": manifest.get("run_key", spec.get("run_key")),
        "experiment": spec.get("experiment"),
        "cell": spec.get("cell"),
        "repetition": spec.get("repetition"),
        "system": spec.get("system"),
        "variant": spec.get("variant"),
        "dataset": spec.get("dataset"),
        "profile": spec.get("profile"),
        "device_mobile": _name(spec.get("device_mobile")),
        "device_edge": _name(spec.get("device_edge")),
        "engine": spec.get("engine"),
        "link_backend": link.get("backend") if isinstance(link, Mapping) else None,
        "seed": spec.get("seed"),
    }


def _name(device: object) -> object:
    return device.get("name") if isinstance(device, Mapping) else device


def _map_size(log: EventLog) -> dict[str, Any]:
    """The global map is the edge's where there is one: its last keyframe_mapped tells."""
    mapped = log.of("keyframe_mapped", node="edge") or log.of("keyframe_mapped")
    if not mapped:
        return {}
    return {"keyframes": mapped[-1].get("keyframes"), "map_points": mapped[-1].get("points")}


def _find_groundtruth(raw_dir: Path, given: Path | None) -> Path | None:
    candidates = [given, raw_dir / "groundtruth.txt"]
    if (sequence := _sequence(raw_dir)) is not None:
        candidates.append(sequence / "groundtruth.txt")
    return next((path for path in candidates if path is not None and path.is_file()), None)


def _sequence(raw_dir: Path) -> Path | None:
    """The prepared sequence that was played."""
    sequence = _read_json(raw_dir / "run.json", []).get("sequence")
    return Path(sequence) if isinstance(sequence, str) else None


def _sensor(raw_dir: Path) -> str | None:
    """What the played sequence brought: rgbd, stereo or mono."""
    sequence = _sequence(raw_dir)
    told = _read_json(sequence / SEQUENCE_FILE, []).get("sensor") if sequence else None
    return told if isinstance(told, str) else None


def _accuracy(raw_dir: Path, truth_file: Path | None, problems: list[str]) -> dict[str, Any]:
    if truth_file is None:
        return {}
    found: dict[str, Any] = {}
    truth = read_tum(truth_file)
    # A single camera knows no scale: its path is judged up to one, and marked.
    free_scale = _sensor(raw_dir) == "mono"
    estimate = _trajectory(raw_dir, "trajectory.txt", problems)
    live = _trajectory(raw_dir, "trajectory_live.txt", problems)
    try:
        error = absolute_error(estimate, truth, with_scale=free_scale)
        found |= {"ate_rmse_m": error.rmse, "ate_pairs": error.pairs}
        found |= {"ate_alignment": error.alignment.lower(), "ate_scale": error.scale}
        drift = relative_error(estimate.scaled(error.scale), truth, RPE_DELTA_S)
        found |= {"rpe_trans_m": drift.translation_m.rmse, "rpe_rot_deg": drift.rotation_deg.rmse}
    except SlambedError as error_line:
        problems.append(f"trajectory.txt: {error_line}")
    try:
        found["ate_live_rmse_m"] = absolute_error(live, truth, with_scale=free_scale).rmse
    except SlambedError as error_line:
        problems.append(f"trajectory_live.txt: {error_line}")
    return found


def _trajectory(raw_dir: Path, name: str, problems: list[str]) -> Trajectory:
    """The mobile node's trajectory; an unreadable one counts as empty."""
    for path in (raw_dir / "mobile" / name, raw_dir / name):
        if path.exists():
            try:
                return read_tum(path)
            except SlambedError as error:
                problems.append(str(error))
                return EMPTY
    return EMPTY


def _times(log: EventLog) -> dict[str, Any]:
    frames = log.of("frame_tracked")
    extract = [e for e in log.of("stage", node="mobile") if e.get("name") == "extract"]
    return {
        "track_ms_median": quantile_of(frames, "track_ms", 0.5),
        "track_ms_mean": mean_of(frames, "track_ms"),
        "track_ms_p95": quantile_of(frames, "track_ms", 0.95),
        "extract_ms_median": quantile_of(extract, "wall_ms", 0.5),
        "local_mapping_ms_mean": mapping_ms_per_keyframe(log, "wall_ms"),
        "local_mapping_cpu_ms_mean": mapping_ms_per_keyframe(log, "cpu_ms"),
    }


def _resources(mobile: Resources, edge: Resources) -> dict[str, Any]:
    return {
        "mobile_cpu_percent_mean": mobile.cpu_percent_mean,
        "edge_cpu_percent_mean": edge.cpu_percent_mean,
        "mobile_mem_mb_peak": mobile.memory_mb_peak,
        "edge_mem_mb_peak": edge.memory_mb_peak,
        "throttled_ms": mobile.throttled_ms,
        "throttled_share": mobile.throttled_share,
    }


def _network(log: EventLog, proof: RttProof | None, has_edge: bool) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if has_edge:
        moved = bytes_moved(log)
        found |= {"bytes_up": moved["up"], "bytes_down": moved["down"]}
        found["updates_applied"] = len(log.of("update_applied"))
        found |= round_summary(log)
        total = total_ms(log)
        if len(total):
            found["update_delay_ms_median"] = quantile_of(
                [{"ms": float(value)} for value in total], "ms", 0.5
            )
    if proof is not None:
        found |= {
            "rtt_asked_ms_mean": proof.asked_mean,
            "rtt_measured_ms_mean": proof.measured_mean,
            "rtt_error_ms_median": proof.error_median,
            "rtt_error_ms_p99": proof.error_p99,
        }
    return found


def _told_proof(manifest: Mapping[str, Any]) -> RttProof | None:
    """The link's own comparison: it knows the profile exactly, with its gaps and queues."""
    link = manifest.get("link")
    proof = link.get("proof") if isinstance(link, Mapping) else None
    if not isinstance(proof, Mapping):
        return None
    names = ("asked_ms_mean", "measured_ms_mean", "error_ms_median", "error_ms_p99")
    numbers = [proof.get(name) for name in names]
    if not all(isinstance(value, int | float) for value in numbers):
        return None
    asked, measured, median, p99 = (float(str(value)) for value in numbers)
    return RttProof(asked, measured, median, p99, int(proof.get("echoes") or 0))


def _base_rtt_ms(manifest: Mapping[str, Any]) -> float:
    """What the path itself takes without added latency, where the link measured it."""
    link = manifest.get("link")
    base = link.get("base_rtt_ms") if isinstance(link, Mapping) else None
    return float(base) if isinstance(base, int | float) else 0.0


def is_virtual(spec: Mapping[str, Any]) -> bool:
    """True for a run in virtual time: its link does what was asked by construction."""
    return spec.get("engine") == VIRTUAL


def _asked_mean(link: pd.DataFrame, end_s: float | None) -> float | None:
    asked = series(link, "asked_rtt_ms")
    if end_s is not None:
        asked = asked[asked["t_s"] <= end_s]
    return float(asked["value"].mean()) if len(asked) else None


def _verdict(
    spec: Mapping[str, Any], manifest: Mapping[str, Any], summary: Mapping[str, Any]
) -> tuple[str, str | None]:
    """Outcome and why the run does not count (None: it counts)."""
    outcome = str(manifest.get("outcome") or "completed")
    if outcome != "completed":
        return outcome, str(manifest.get("invalid_reason") or outcome.replace("_", " "))
    if told := manifest.get("invalid_reason"):
        return outcome, str(told)
    if not summary["frames_total"]:
        return outcome, "no frame was played"
    tolerances = spec.get("tolerances") or {}
    stall, bearable = summary["host_stall_ms_max"], tolerances.get("host_stall_ms_max")
    if stall is not None and bearable is not None and stall > bearable:
        return (
            outcome,
            f"the host stalled the mobile node for {stall:.0f} ms, above {bearable:g} ms",
        )
    if not spec.get("link") or is_virtual(spec):
        return outcome, None
    record = manifest.get("link")
    if isinstance(record, Mapping) and (told := record.get("invalid_reason")):
        return outcome, str(told)
    for key, name in (("rtt_error_ms_median", "median"), ("rtt_error_ms_p99", "p99")):
        allowed = tolerances.get(key)
        if allowed is None:
            continue
        error = summary[key]
        if error is None:
            return outcome, "the RTT of the link was not measured"
        if error > allowed:
            return outcome, f"RTT error {name} {error:.2f} ms is above {allowed:g} ms"
    return outcome, None


def _read_json(path: Path, problems: list[str]) -> dict[str, Any]:
    if not path.exists():
        return {}
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        problems.append(f"{path.name}: unreadable ({error})")
        return {}
    return value if isinstance(value, dict) else {}


__all__ = [
    "SUMMARY_KEYS",
    "playback_end_s",
    "summarise_run",
    "summarise_with_problems",
    "values_of",
]
