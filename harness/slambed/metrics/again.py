# SPDX-License-Identifier: Apache-2.0
"""The numbers of a stored run once more, from its events: after a metric or a true path changed."""

import json
from pathlib import Path
from typing import Any

from slambed.errors import SlambedError
from slambed.json_file import read_object
from slambed.metrics.digest import digest
from slambed.metrics.run import summarise_with_problems


def recompute_run(folder: Path, groundtruth: Path | None) -> list[str]:
    """Writes summary.json and the manifest's digest of a result anew; the keys that changed.

    Equal to what a run made today would say of the same raw files. Raises SlambedError, and leaves
    everything as it is, where the events or the manifest cannot be read.
    """
    manifest, old = read_object(folder / "manifest.json"), read_object(folder / "summary.json")
    spec = (manifest or {}).get("spec")
    if manifest is None or old is None or not isinstance(spec, dict):
        raise SlambedError(f"{folder}: without a whole manifest its numbers stay what they are")
    if not (folder / "events.parquet").is_file():
        raise SlambedError(f"{folder}: without events.parquet its numbers stay what they are")
    new, problems = summarise_with_problems(folder, spec, groundtruth)
    if torn := [line for line in problems if line.startswith("events.parquet")]:
        raise SlambedError(f"{folder}: {torn[0]}, its numbers stay what they are")
    changed = [key for key in dict.fromkeys([*new, *old]) if new.get(key) != old.get(key)]
    _replace(folder / "summary.json", new)
    told = manifest.get("warnings")
    warnings = [*told] if isinstance(told, list) else []
    warnings += [line for line in problems if line not in warnings]
    facts = manifest | {"warnings": warnings, "results_sha256": digest(folder)}
    if facts != manifest:
        _replace(folder / "manifest.json", facts)
    return changed


def _replace(path: Path, content: dict[str, Any]) -> None:
    """By one rename: a kill leaves the old file or the new one."""
    partial = path.with_name(f".{path.name}.partial")
    partial.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n")
    partial.rename(path)
