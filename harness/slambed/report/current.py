# SPDX-License-Identifier: Apache-2.0
"""Whether a report is one of the runs that are there: a campaign may have been killed between its
last run and its report, or while that was being written."""

import hashlib
from pathlib import Path

STAMP = "made_of.sha256"


def made_of(experiment_dir: Path) -> str:
    """One number for the runs that a report reports, with what was computed from them."""
    digest = hashlib.sha256()
    for summary in sorted((experiment_dir / "runs").glob("*/summary.json")):
        digest.update(f"{summary.parent.name} ".encode() + summary.read_bytes())
    return digest.hexdigest()


def is_current(experiment_dir: Path) -> bool:
    """Whether the report is there, whole, and of these runs."""
    stamp = experiment_dir / "report" / STAMP
    return stamp.is_file() and stamp.read_text() == made_of(experiment_dir)


def begin(experiment_dir: Path, place: Path) -> str:
    """What the report in `place` will be made of. Until `finish` there is no whole one."""
    (place / "report" / STAMP).unlink(missing_ok=True)
    return made_of(experiment_dir)


def finish(place: Path, runs: str) -> None:
    """The report is whole."""
    (place / "report" / STAMP).write_text(runs)
