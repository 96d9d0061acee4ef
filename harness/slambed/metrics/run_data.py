# SPDX-License-Identifier: Apache-2.0
"""The data of one run for its metrics, from its raw folder or stored result; loaded lazily."""

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from math import fsum
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from slambed.data.prepared import SEQUENCE_FILE
from slambed.data.trajectory import EMPTY, Trajectory, read_tum
from slambed.errors import SlambedError
from slambed.files.json_file import object_or_empty
from slambed.link.facts import LinkFacts
from slambed.link.proof import LinkProof
from slambed.metrics.accuracy import (
    absolute_error,
    absolute_error_and_alignment,
    relative_error,
    relative_error_over_all,
)
from slambed.metrics.board_clock import on_one_clock
from slambed.metrics.collect import is_stored, read_link, read_log, read_samples
from slambed.metrics.culling import Culling, culling_of
from slambed.metrics.device_share import device_cores
from slambed.metrics.events import EventLog
from slambed.metrics.in_force import error_in_force_m_mean
from slambed.metrics.kitti_error import kitti_error
from slambed.metrics.network import (
    NO_RTT_FIGURES,
    RttFigures,
    bytes_moved,
    curve,
    measured_only,
    rtt_figures,
)
from slambed.metrics.recovery import known_place_times_s
from slambed.metrics.reference_path import ReferenceErrors, reference_errors, scored_part
from slambed.metrics.resources import NOTHING, Resources, resources_of
from slambed.metrics.summary import Summary
from slambed.metrics.tracking import Tracking, tracking_of
from slambed.metrics.update_round import UpdateRound, update_rounds
from slambed.records.kept_spec import KeptSpec
from slambed.records.manifest import Manifest
from slambed.segment.mask_cache import LABELS_FILE
from slambed.spec.board import NETWORK

RPE_DELTA_S = 1.0
REFERENCE_FILE = "reference.txt"
"""File in a run's folder: the path that the live path is compared with."""


@dataclass(frozen=True)
class Accuracy:
    """Errors of the estimated path relative to the ground truth; None: unknown."""

    ate_rmse_m: float | None = None
    ate_mean_m: float | None = None
    ate_pairs: int | None = None
    ate_alignment: str | None = None
    ate_scale: float | None = None
    rpe_trans_m: float | None = None
    rpe_rot_deg: float | None = None
    rpe_frame_trans_m: float | None = None
    rpe_frame_rot_deg: float | None = None
    rpe_all_trans_m: float | None = None
    rpe_all_rot_deg: float | None = None
    ate_live_rmse_m: float | None = None
    error_in_force_m_mean: float | None = None
    rte_percent: float | None = None
    rre_deg_per_m: float | None = None
    rte_short_percent: float | None = None
    rre_short_deg_per_m: float | None = None


@dataclass
class RunData:
    """A run's folder, its RunSpec, and read errors (`problems`).

    The ground truth is `groundtruth`, else `groundtruth.txt` in the folder, else that of the played
    sequence.
    """

    folder: Path
    spec: KeptSpec
    groundtruth: Path | None = None
    facts: Manifest | None = None
    """The manifest, if its file is not written yet."""
    problems: list[str] = field(default_factory=list)

    @cached_property
    def manifest(self) -> Manifest:
        """Outcome and circumstances of the run."""
        if self.facts is not None:
            return self.facts
        return Manifest.read_or_complain(self.folder / "manifest.json", self.problems)

    @cached_property
    def log(self) -> EventLog:
        """Events of all nodes, on the edge's clock."""
        log = read_log(self.folder)
        board = self.manifest.board
        if board is not None and board.clocks is not None and not is_stored(self.folder):
            log = on_one_clock(log, board.clocks)
        self.problems += log.problems
        return log

    @cached_property
    def samples(self) -> pd.DataFrame:
        """Samples of the sampler."""
        samples, complaints = read_samples(self.folder)
        self.problems += complaints
        return samples

    @cached_property
    def link(self) -> pd.DataFrame | None:
        """The link's series; None without a link."""
        link, complaints = read_link(self.folder)
        self.problems += complaints
        return link

    @property
    def measured(self) -> bool:
        """Whether there is any event."""
        return len(self.log.events) > 0

    @property
    def has_edge(self) -> bool:
        """Whether the run had a second node."""
        return self.spec.device_edge is not None

    @property
    def is_virtual(self) -> bool:
        """True in virtual time, where the link is exact by construction."""
        return self.spec.is_virtual

    @cached_property
    def end_s(self) -> float | None:
        """Run time of the last frame event: the end of playback."""
        frames = self.log.of("frame_tracked", "frame_dropped")
        return frames[-1]["t_ns"] / 1e9 if frames else None

    @property
    def outcome(self) -> str:
        """Outcome of the system."""
        return self.manifest.outcome or "completed"

    @cached_property
    def tracking(self) -> Tracking:
        """Counts of the frame states."""
        return tracking_of(self.log)

    @cached_property
    def frames_offered(self) -> int | None:
        """Number of frames in the playback plan, which also counts frames that the node did not
        report."""
        planned, playback = self.manifest.frames_offered, self.spec.playback
        stops = playback is not None and playback.stop_at_first_loss
        if planned is None or (stops and self.tracking.track_losses):
            return self.tracking.frames_total if self.measured else None
        return planned

    @cached_property
    def frames_tracked(self) -> int | None:
        """Number of tracked frames by the frame events; for a system without them, by the poses
        of its trajectory."""
        if self.log.of("frame_tracked", "frame_dropped"):
            return self.tracking.frames_tracked
        if self.frames_offered is None:
            return None
        live = self._trajectory("trajectory_live.txt")
        poses = len(live) or len(self._trajectory("trajectory.txt"))
        return min(poses, self.frames_offered)

    @property
    def coverage(self) -> float | None:
        """Share of the offered frames with a pose; 0 if the system did not complete."""
        if self.outcome != "completed":
            return 0.0
        if not self.frames_offered or self.frames_tracked is None:
            return None
        return self.frames_tracked / self.frames_offered

    @property
    def coverage_processed(self) -> float | None:
        """Share of the offered frames that tracking processed, with or without a pose."""
        if self.spec.reads_folder:
            return None
        taken = len(self.log.of("frame_tracked"))
        return taken / self.frames_offered if self.measured and self.frames_offered else None

    @cached_property
    def host_steal_percent(self) -> float | None:
        """Steal time as a percentage of the CPU time of all CPUs, over playback."""
        cores = self.manifest.cores
        if cores is None or "host_steal_s" not in self.samples:
            return None
        rows = self.samples[self.samples["t_s"] >= 0] if len(self.samples) else self.samples
        if self.end_s is not None and len(rows):
            rows = rows[rows["t_s"] <= self.end_s]
        if self.manifest.board:  # rows of the mobile node hold the board's counter
            rows = rows[rows["node"].eq("edge")]
        rows = rows.dropna(subset=["host_steal_s"]).sort_values("t_s", kind="stable")
        span_s = float(rows["t_s"].iloc[-1] - rows["t_s"].iloc[0]) if len(rows) > 1 else 0.0
        if span_s <= 0:
            return None
        stolen_s = float(rows["host_steal_s"].iloc[-1] - rows["host_steal_s"].iloc[0])
        return 100.0 * stolen_s / (span_s * cores)

    @cached_property
    def mobile(self) -> Resources:
        """CPU, memory and throttling of the mobile node."""
        # Without a frame (the mobile node died early) the window covers all samples.
        return resources_of(self.samples, "mobile", self.end_s)

    @property
    def mobile_cores(self) -> float | None:
        """Cores of the whole mobile device."""
        return device_cores(self.spec, self.manifest, "mobile")

    @cached_property
    def edge(self) -> Resources:
        """CPU, memory and throttling of the edge; empty without one."""
        return resources_of(self.samples, "edge", self.end_s) if self.has_edge else NOTHING

    @cached_property
    def bytes_moved(self) -> dict[str, int | None]:
        """Bytes `up` and `down`; None without an edge. For a system that logs no messages: bytes
        carried by the link, including headers."""
        if not self.has_edge:
            return {"up": None, "down": None}
        moved = bytes_moved(self.log)
        link = self.manifest.link
        carried = None if link is None else link.details.carried_bytes
        if moved["up"] is None and carried is not None:
            return {way: carried[way] for way in ("up", "down")}
        return moved

    @cached_property
    def rounds(self) -> list[UpdateRound]:
        """Accepted map updates that report their parts."""
        return update_rounds(self.log) if self.has_edge else []

    @cached_property
    def rtt(self) -> RttFigures:
        """Measured and commanded RTT: from the link proof, or else from the logged series."""
        link = self.manifest.link or LinkFacts()
        measured = _figures_in_manifest(link.proof)
        if link.backend == NETWORK and self.link is not None:
            return measured_only(self.link, self.end_s)
        if measured is None and self.link is not None:
            measured = rtt_figures(self.link, link.base_rtt_ms or 0.0, self.end_s)
        return measured or NO_RTT_FIGURES

    @cached_property
    def asked_rtt_ms_mean(self) -> float | None:
        """Mean RTT of the profile over playback, even without probes."""
        if self.rtt.asked_mean is not None or not self.is_virtual or self.link is None:
            return self.rtt.asked_mean
        times_s, asked = curve(self.link, "asked_rtt_ms")
        if self.end_s is not None:
            asked = asked[times_s <= self.end_s]
        return float(asked.mean()) if len(asked) else None

    @cached_property
    def truth_file(self) -> Path | None:
        """The ground truth file of this run."""
        candidates = [self.groundtruth, self.folder / "groundtruth.txt"]
        if self._sequence is not None:
            candidates.append(self._sequence / "groundtruth.txt")
        return next((path for path in candidates if path is not None and path.is_file()), None)

    @cached_property
    def accuracy(self) -> Accuracy:
        """Errors of the final and of the live path."""
        if self.truth_file is None:
            return Accuracy()
        truth = self._truth
        # The scale of a monocular system is unobservable, so its path is aligned with Sim3 and
        # marked.
        free_scale = self.sensor == "mono"
        found: dict[str, Any] = {}
        estimate, live = self._trajectory("trajectory.txt"), self._trajectory("trajectory_live.txt")
        try:
            error, alignment = absolute_error_and_alignment(estimate, truth, with_scale=free_scale)
            if not self.spec.reads_folder:
                in_force = error_in_force_m_mean(self.log, live, truth, alignment)
                found["error_in_force_m_mean"] = in_force
            found |= {"ate_rmse_m": error.rmse, "ate_mean_m": error.mean, "ate_pairs": error.pairs}
            found |= {"ate_alignment": error.alignment.lower(), "ate_scale": error.scale}
            if truth.has_orientation:
                _add_relative(found, estimate.scaled(error.scale), truth)
        except SlambedError as error_line:
            self.problems.append(f"trajectory.txt: {error_line}")
        if self.spec.reads_folder:
            return Accuracy(**found)  # live poses are unknown
        try:
            error = absolute_error(live, truth, with_scale=free_scale)
            found["ate_live_rmse_m"] = error.rmse
        except SlambedError as error_line:
            self.problems.append(f"trajectory_live.txt: {error_line}")
        return Accuracy(**found)

    @cached_property
    def reference(self) -> ReferenceErrors:
        """Distance of the live path to that of the reference run, if there is one."""
        if not (self.folder / REFERENCE_FILE).is_file():
            return ReferenceErrors()
        scored = scored_part(self._trajectory("trajectory_live.txt"), self.log)
        try:
            return reference_errors(scored, read_tum(self.folder / REFERENCE_FILE))
        except SlambedError as error_line:
            self.problems.append(f"{REFERENCE_FILE}: {error_line}")
            return ReferenceErrors()

    @cached_property
    def culling(self) -> Culling:
        """Culling metrics of a run that logs its features, if its labeled sequence is on this
        machine."""
        features = self.log.of("frame_features")
        border_px = (self.spec.params or {}).get("mask_border_px", 0)
        labeled = (folder for folder in self._folders if (folder / LABELS_FILE).is_file())
        if not features or (sequence := next(labeled, None)) is None:
            return Culling()
        try:
            return culling_of(features, sequence, int(str(border_px)))
        except (SlambedError, KeyError, ValueError) as error:
            self.problems.append(f"frame_features: {error}")
            return Culling()

    @property
    def known_place_s(self) -> float | None:
        """Mean relocalization time of a lost camera that returned to a known place; None: it
        never did, or where it looked is unknown."""
        if self.truth_file is None or not self.tracking.track_losses:
            return None
        if not self._truth.has_orientation:
            return None
        live = self._trajectory("trajectory_live.txt")
        waits = known_place_times_s(self.log, live, self._truth)
        return fsum(waits) / len(waits) if waits else None

    @cached_property
    def sensor(self) -> str | None:
        """Sensor of the played sequence: rgbd, stereo or mono."""
        headers = [folder / SEQUENCE_FILE for folder in self._folders]
        found = next((header for header in headers if header.is_file()), None)
        named = object_or_empty(found).get("sensor") if found else None
        if named is None and self._stored.get("ate_alignment") == "sim3":
            return "mono"  # the sequence is gone, so use its stored summary
        return named if isinstance(named, str) else None

    @cached_property
    def _stored(self) -> Summary:
        """The stored summary of a result."""
        return Summary.read(self.folder / "summary.json") or Summary()

    @property
    def _folders(self) -> list[Path]:
        """Folders that may be the played sequence."""
        # A container's run.json has a path inside the container; then the folder of the ground
        # truth is used.
        folders = [self._sequence, self.groundtruth.parent if self.groundtruth else None]
        return [folder for folder in folders if folder is not None]

    @cached_property
    def _sequence(self) -> Path | None:
        """The prepared sequence that was played."""
        for path in (self.folder / "run.json", self.folder / "nodes" / "run.json"):
            named = object_or_empty(path).get("sequence")
            if isinstance(named, str):
                return Path(named)
        return None

    def _trajectory(self, name: str) -> Trajectory:
        """Returns a trajectory of the mobile node, read once; an unreadable one counts as empty."""
        if name not in self._read:
            self._read[name] = self._read_trajectory(name)
        return self._read[name]

    @cached_property
    def _read(self) -> dict[str, Trajectory]:
        return {}

    @cached_property
    def _truth(self) -> Trajectory:
        """The ground truth of a run that has one."""
        assert self.truth_file is not None
        status = self.truth_file.stat()
        return _read_once(self.truth_file, status.st_mtime_ns, status.st_size)

    def _read_trajectory(self, name: str) -> Trajectory:
        for path in (self.folder / "mobile" / name, self.folder / name):
            if path.exists():
                try:
                    return read_tum(path)
                except SlambedError as error:
                    self.problems.append(str(error))
                    return EMPTY
        return EMPTY


def _add_relative(found: dict[str, Any], estimate: Trajectory, truth: Trajectory) -> None:
    """Adds the errors that orientations are in: per length of path, and of pairs of poses."""
    if (parts := kitti_error(estimate, truth)) is not None:
        short = "_short" if parts.short else ""
        found[f"rte{short}_percent"] = parts.translation_percent
        found[f"rre{short}_deg_per_m"] = parts.rotation_deg_per_m
    everywhere = relative_error_over_all(estimate, truth)
    found["rpe_all_trans_m"] = everywhere.translation_m.rmse
    found["rpe_all_rot_deg"] = everywhere.rotation_deg.rmse
    drift = relative_error(estimate, truth, RPE_DELTA_S)
    found["rpe_trans_m"] = drift.translation_m.rmse
    found["rpe_rot_deg"] = drift.rotation_deg.rmse
    step = relative_error(estimate, truth, delta_s=None)
    found["rpe_frame_trans_m"] = step.translation_m.rmse
    found["rpe_frame_rot_deg"] = step.rotation_deg.rmse


@lru_cache(maxsize=4)
def _read_once(path: Path, mtime_ns: int, size: int) -> Trajectory:
    """Reads a ground truth, which is the same for all runs of a sequence, once per process."""
    return read_tum(path)


def _figures_in_manifest(proof: LinkProof | None) -> RttFigures | None:
    """Returns the figures of the link proof, which knows the profile exactly, with its gaps and
    queues."""
    if proof is None:
        return None
    numbers = (
        proof.asked_ms_mean,
        proof.measured_ms_mean,
        proof.error_ms_median,
        proof.error_ms_p99,
    )
    return RttFigures(*numbers, proof.echoes) if np.isfinite(numbers).all() else None
