# SPDX-License-Identifier: Apache-2.0
"""From a RunSpec to a raw folder with manifest, tables and summary: the same for every engine."""

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from slambed.campaign.folder import MOBILE_FILES
from slambed.campaign.ledger import utc_now
from slambed.campaign.manifest import manifest
from slambed.engines.result import RunResult
from slambed.metrics.collect import to_parquet
from slambed.metrics.run import summarise_with_problems
from slambed.spec import inputs
from slambed.spec.matrix import RunSpec


def make_run(
    spec: RunSpec,
    raw: Path,
    sequence: Path,
    engine: dict[str, Any],
    execute: Callable[[], RunResult],
) -> dict[str, Any]:
    """Executes a run whose raw files land in `raw`, and adds what makes them a result.

    `engine` is what the engine says about itself. Returns the summary.
    """
    inputs.bring(raw, {name: str(spec.params[name]) for name in spec.inputs}, spec.inputs)
    started, load = utc_now(), os.getloadavg()[0]
    result = execute()
    facts = manifest(spec, engine, result, started, load)
    _write(raw / "manifest.json", facts)
    truth = sequence / "groundtruth.txt"
    summary, problems = summarise_with_problems(
        raw, facts["spec"], truth if truth.is_file() else None
    )
    problems += [p for p in to_parquet(raw, raw).problems if p not in problems]
    _write(raw / "summary.json", summary)
    _write(raw / "manifest.json", facts | {"warnings": problems, "results_sha256": digest(raw)})
    return summary


def digest(raw: Path) -> str:
    """SHA-256 over names and bytes of everything a run measured: summary, tables, trajectories.

    Circumstances (manifest, logs) are left out, so equal virtual runs have equal digests.
    """
    files = [raw / "summary.json", *raw.glob("*.parquet")]
    files += [raw / "mobile" / name for name in MOBILE_FILES]
    total = hashlib.sha256()
    for path in sorted(files, key=lambda path: path.name):
        if path.is_file():
            content = hashlib.sha256(path.read_bytes()).hexdigest()
            total.update(f"{path.name} {content}\n".encode())
    return total.hexdigest()


def _write(path: Path, content: dict[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n")
