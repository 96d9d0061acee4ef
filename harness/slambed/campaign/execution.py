# SPDX-License-Identifier: Apache-2.0
"""From a RunSpec to a raw folder with manifest, tables and summary: the same for every engine."""

import json
import os
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from slambed.campaign.ledger import utc_now
from slambed.campaign.manifest import manifest
from slambed.data.playlist import offered_frames
from slambed.data.prepared import SEQUENCE_FILE, PreparedSequence
from slambed.engines.result import RunResult
from slambed.metrics.digest import digest
from slambed.metrics.parquet import to_parquet
from slambed.metrics.run import summary_of
from slambed.metrics.run_data import REFERENCE_FILE, RunData
from slambed.metrics.summary import Summary
from slambed.records.manifest import EngineFacts
from slambed.spec import inputs
from slambed.spec.run_spec import RunSpec


def execute_run(
    spec: RunSpec,
    raw: Path,
    sequence: Path,
    engine: EngineFacts,
    command: list[str],
    execute: Callable[[], RunResult],
    attempt: int = 1,
) -> Summary:
    """Executes a run whose raw files land in `raw`, and adds what makes them a result.

    `engine` is what the engine says about itself, `command` what the user called. Returns the
    summary.
    """
    inputs.copy_inputs(raw, {name: str(spec.params[name]) for name in spec.inputs}, spec.inputs)
    if spec.reference:
        shutil.copyfile(spec.reference, raw / REFERENCE_FILE)
    started, load = utc_now(), os.getloadavg()[0]
    result = execute()
    offered = frames_offered(spec, sequence)
    facts = manifest(spec, engine, command, result, started, load, attempt, offered)
    truth = sequence / "groundtruth.txt"
    run = RunData(raw, facts.kept, truth if truth.is_file() else None, facts)
    summary = summary_of(run)
    problems = to_parquet(run, raw).problems
    _write(raw / "summary.json", summary)
    whole = facts.model_copy(update={"warnings": problems, "results_sha256": digest(raw)})
    _write(raw / "manifest.json", whole.as_json())
    return summary


def frames_offered(spec: RunSpec, sequence: Path) -> int | None:
    """How many frames playback offers by its plan; None for what is no prepared sequence."""
    if not (sequence / SEQUENCE_FILE).is_file():
        return None
    prepared = PreparedSequence.open(sequence)
    play = spec.playback
    times_ns = prepared.index["timestamp_ns"].astype(np.int64)
    return len(offered_frames(times_ns, prepared.info.fps, play.fps, play.start_s, play.end_s))


def _write(path: Path, content: Mapping[str, object]) -> None:
    path.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n")
