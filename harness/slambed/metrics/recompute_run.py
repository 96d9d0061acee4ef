# SPDX-License-Identifier: Apache-2.0
"""Recomputes the metrics of a stored run from its events, after a metric or the ground truth
changed."""

import json
from collections.abc import Mapping
from pathlib import Path

from slambed.errors import SlambedError
from slambed.files.atomic import replacing
from slambed.files.json_file import read_object
from slambed.metrics.digest import digest
from slambed.metrics.run_summary import summarize_with_problems
from slambed.metrics.summary import Summary
from slambed.records.manifest import FILE, Manifest


def recompute_run(folder: Path, groundtruth: Path | None) -> list[str]:
    """Rewrites summary.json and the manifest's digest of a result; returns the changed keys.

    The result equals that of the same raw files in a run executed now. Raises SlambedError, and
    changes nothing, if the events or the manifest cannot be read.
    """
    manifest, old = Manifest.read(folder / FILE), Summary.read(folder / "summary.json")
    if manifest is None or old is None or manifest.spec is None:
        raise SlambedError(f"{folder}: without a whole manifest its numbers stay what they are")
    if not (folder / "events.parquet").is_file():
        raise SlambedError(f"{folder}: without events.parquet its numbers stay what they are")
    new, problems = summarize_with_problems(folder, manifest.kept, groundtruth)
    if torn := [line for line in problems if line.startswith("events.parquet")]:
        raise SlambedError(f"{folder}: {torn[0]}, its numbers stay what they are")
    changed = [key for key in dict.fromkeys([*new, *old]) if new.get(key) != old.get(key)]
    _replace(folder / "summary.json", new)
    warnings = list(manifest.warnings or [])
    warnings += [line for line in problems if line not in warnings]
    # Edits the file instead of the record, to keep fields of other versions.
    before = read_object(folder / FILE) or {}
    facts = before | {"warnings": warnings, "results_sha256": digest(folder)}
    if facts != before:
        _replace(folder / FILE, facts)
    return changed


def _replace(path: Path, content: Mapping[str, object]) -> None:
    """Writes atomically: a kill leaves the old or the new file."""
    with replacing(path) as out:
        out.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n")
