# SPDX-License-Identifier: Apache-2.0
"""The numbers of a stored run once more, from its events: after a metric or a true path changed."""

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
    """Writes summary.json and the manifest's digest of a result anew; the keys that changed.

    Equal to what a run made today would say of the same raw files. Raises SlambedError, and leaves
    everything as it is, where the events or the manifest cannot be read.
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
    # The file, not the record: what another version wrote besides stays.
    before = read_object(folder / FILE) or {}
    facts = before | {"warnings": warnings, "results_sha256": digest(folder)}
    if facts != before:
        _replace(folder / FILE, facts)
    return changed


def _replace(path: Path, content: Mapping[str, object]) -> None:
    """By one rename: a kill leaves the old file or the new one."""
    with replacing(path) as out:
        out.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n")
