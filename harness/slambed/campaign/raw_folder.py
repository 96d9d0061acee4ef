# SPDX-License-Identifier: Apache-2.0
"""Prepares the raw folder of a run, and adds manifest, tables and summary, for every engine."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from slambed.campaign.foreign_trajectory import record_poses
from slambed.campaign.ledger import utc_now
from slambed.campaign.left_files import judge_files, judge_paths
from slambed.campaign.manifest import manifest
from slambed.campaign.recordings import Recording, played_frames
from slambed.data.prepared import SEQUENCE_FILE, PreparedSequence
from slambed.engines.result import RunResult
from slambed.errors import SlambedError
from slambed.files.json_file import read_object
from slambed.metrics.digest import digest
from slambed.metrics.parquet import to_parquet
from slambed.metrics.run_data import REFERENCE_FILE, RunData
from slambed.metrics.run_summary import summary_of
from slambed.metrics.summary import Summary
from slambed.records.manifest import EngineFacts
from slambed.spec import inputs
from slambed.spec.run_spec import RunSpec


@dataclass(frozen=True)
class Start:
    """Start time of a run, and the load of the host then."""

    utc: str
    load: float


def prepare_raw(spec: RunSpec, raw: Path) -> Start:
    """Copies the run's inputs into its folder; called immediately before the run. Raises
    SlambedError if an input is gone or changed: a node would refuse it, which is a result."""
    for masks in filter(None, [spec.masks, *spec.further_masks]):
        masks.must_be_there()
    inputs.copy_inputs(raw, {name: str(spec.params[name]) for name in spec.inputs}, spec.inputs)
    if (reference := reference_of(spec)) is not None:
        (raw / REFERENCE_FILE).write_bytes(reference)
    return Start(utc_now(), os.getloadavg()[0])


def reference_of(spec: RunSpec) -> bytes | None:
    """Returns the content of the path that the run is compared with; None without one. Raises
    SlambedError if it is gone, as after `slambed cache prune`."""
    if not spec.reference:
        return None
    try:
        return Path(spec.reference).read_bytes()
    except FileNotFoundError as gone:
        raise SlambedError(
            f"{spec.reference}, which the run is compared with, is gone; start the campaign again, "
            "which makes it"
        ) from gone


def must_be_prepared(spec: RunSpec, sequence: Path) -> None:
    """Raises SlambedError if the sequence of a run is gone or became another one, which a node
    would refuse: that is a result, which no later campaign makes again. Reads only its header."""
    header = sequence / SEQUENCE_FILE
    found = read_object(header)
    if found is None:
        raise SlambedError(
            f"{header} is gone or damaged; start the campaign again, which prepares it"
        )
    if found.get("checksum") != spec.sequence_checksum:
        raise SlambedError(f"{header} has changed since the campaign began; start it again")


def add_summary(
    spec: RunSpec,
    raw: Path,
    sequence: Path,
    engine: EngineFacts,
    command: list[str],
    start: Start,
    result: RunResult,
    attempt: int = 1,
) -> Summary:
    """Turns the raw files of a run into a result: adds tables, summary and manifest.

    `engine` holds the engine's own facts, `command` the user's command line. Returns the summary.
    """
    result = judge_files(result, raw)
    if spec.runtime is not None and spec.runtime.reads is not None:
        recording = recording_of(spec, sequence)
        result = record_poses(result, spec.runtime, recording, raw)
    result = judge_paths(result, raw)
    offered = frames_offered(spec, sequence)
    facts = manifest(spec, engine, command, result, start.utc, start.load, attempt, offered)
    truth = sequence / "groundtruth.txt"
    run = RunData(raw, facts.kept, truth if truth.is_file() else None, facts)
    summary = summary_of(run)
    problems = to_parquet(run, raw).problems
    _write(raw / "summary.json", summary)
    whole = facts.model_copy(update={"warnings": problems, "results_sha256": digest(raw)})
    _write(raw / "manifest.json", whole.as_json())
    return summary


def frames_offered(spec: RunSpec, sequence: Path) -> int | None:
    """Returns the number of frames in the playback plan; None for an input that is not a
    prepared sequence."""
    if not (sequence / SEQUENCE_FILE).is_file():
        return None
    return len(played_frames(PreparedSequence.open(sequence), spec.playback))


def recording_of(spec: RunSpec, sequence: Path) -> Recording:
    """Returns the recorded folder for a system that reads one."""
    assert spec.runtime is not None and spec.runtime.reads is not None
    return Recording.of(PreparedSequence.open(sequence), spec.playback, spec.runtime.reads)


def _write(path: Path, content: Mapping[str, object]) -> None:
    path.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n")
