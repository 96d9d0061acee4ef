# SPDX-License-Identifier: Apache-2.0
"""Systems with their own program: the Python packages and input files that their runs had."""

from pathlib import PurePath

import pandas as pd

from slambed.records.manifest import Manifest

COLUMN = "program"
DIGEST = 12
"""Hexadecimal digits of a file's SHA-256 that are shown."""


def program_fact(manifest: Manifest) -> dict[str, object]:
    """Returns the column of a run whose system has its own program; empty for other runs."""
    spec = manifest.kept
    if spec.runtime is None:
        return {}
    packages = [f"{name} {version}" for name, version in (manifest.python_packages or {}).items()]
    files = [
        f"{name} {PurePath(str((spec.params or {}).get(name, ''))).name} (SHA-256 {sha[:DIGEST]})"
        for name, sha in sorted(spec.inputs.items())
    ]
    parts = [", ".join(found) for found in (packages, files) if found]
    return {COLUMN: "; ".join(parts)} if parts else {}


def program_lines(runs: pd.DataFrame) -> list[str]:
    """Returns one sentence for each system and each of its programs, with the number of runs unless
    all runs of the system had it."""
    if COLUMN not in runs:
        return []
    found = []
    for (system, text), own in runs.groupby(["system", COLUMN], sort=False):
        every = int((runs["system"] == system).sum())
        of = "" if len(own) == every else f" in {len(own)} of {every} runs"
        found.append(f"{system} runs with {text}{of}.")
    return found
