# SPDX-License-Identifier: Apache-2.0
"""Checks that a report belongs to the stored runs: a campaign may have been killed before or while
it wrote the report."""

import hashlib
from pathlib import Path

STAMP = "made_of.sha256"


def made_of(experiment_dir: Path) -> str:
    """Returns a digest of all runs of a report and their summaries."""
    digest = hashlib.sha256()
    for summary in sorted((experiment_dir / "runs").glob("*/summary.json")):
        digest.update(f"{summary.parent.name} ".encode() + summary.read_bytes())
    return digest.hexdigest()


def is_current(experiment_dir: Path) -> bool:
    """Returns whether the report exists, is complete, and is of these runs."""
    stamp = experiment_dir / "report" / STAMP
    return stamp.is_file() and stamp.read_text() == made_of(experiment_dir)


def begin(experiment_dir: Path, place: Path) -> str:
    """Returns the digest of the runs, and marks the report in `place` as incomplete until
    `finish`."""
    (place / "report" / STAMP).unlink(missing_ok=True)
    return made_of(experiment_dir)


def finish(place: Path, runs: str) -> None:
    """Marks the report as complete."""
    (place / "report" / STAMP).write_text(runs)
