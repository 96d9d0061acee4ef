# SPDX-License-Identifier: Apache-2.0
"""What of an experiment is there, what is missing or stale, and why."""

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from slambed.campaign.folder import ResultFolder
from slambed.campaign.plan import planned_runs
from slambed.errors import SlambedError
from slambed.json_file import read_object
from slambed.metrics.summary import Summary
from slambed.spec.library import Library
from slambed.spec.run_spec import RunSpec


@dataclass
class CellStatus:
    """Runs of one cell."""

    cell: str
    trusted: int = 0
    untrusted: list[str] = field(default_factory=list)
    """Why, one line per run."""
    missing: int = 0


@dataclass
class Status:
    """Runs of an experiment as it was last expanded."""

    cells: list[CellStatus]
    notes: list[str]

    @property
    def complete(self) -> bool:
        """True when every run is there and to be trusted."""
        return all(not cell.missing and not cell.untrusted for cell in self.cells)


def was_run(results: Path, name: str) -> bool:
    """True when a campaign has begun at least."""
    folder = ResultFolder(results / name)
    return (folder.path / "experiment.json").exists() or bool(folder.run_keys())


def not_run_yet(name: str) -> str:
    """What there is to say of an experiment that was never run; a mistake in it is raised."""
    library = Library()
    experiment, source = library.experiment(name)
    # What is not on this machine is known when its turn comes.
    most = "at most " if experiment.missing_datasets == "skip" else ""
    count = planned_runs(experiment, source, library)
    return f"not run yet: 0 of {most}{count} runs; start with 'slambed run {name}'"


def status_of(results: Path, name: str, yaml_path: Path | None, software: set[str]) -> Status:
    """Compares experiment.json with the run folders. `software`: tags of what would run now."""
    folder = ResultFolder(results / name)
    content = read_object(folder.path / "experiment.json") or {}
    try:
        specs = [RunSpec.model_validate(_without_key(run)) for run in content["runs"]]
    except (ValueError, KeyError, TypeError):
        raise SlambedError(
            f"{folder.path / 'experiment.json'} is missing or not whole; "
            f"'slambed run {name}' writes it anew"
        ) from None
    cells: dict[str, CellStatus] = {}
    for spec in specs:
        cell = cells.setdefault(spec.cell, CellStatus(spec.cell))
        match folder.state(spec.run_key):
            case "trusted":
                cell.trusted += 1
            case "untrusted":
                summary = folder.summary(spec.run_key) or Summary()
                cell.untrusted.append(f"{spec.run_key}: {summary.get('distrust')}")
            case _:
                cell.missing += 1
    notes = [f"{key}: not a run of this experiment, in {folder.runs}" for key in _foreign(folder)]
    if yaml_path is not None and yaml_path.is_file():
        digest = hashlib.sha256(yaml_path.read_bytes()).hexdigest()
        if digest != content.get("file", {}).get("sha256"):
            notes.append(f"{yaml_path.name} has changed since; 'slambed run' takes the new one")
    if software and content.get("software") not in software:
        notes.append(
            "C++ sources have changed since: 'slambed run' executes the runs of the systems that "
            "link them; what is there stays"
        )
    return Status(list(cells.values()), notes)


def _without_key(run: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in run.items() if key != "run_key"}


def _foreign(folder: ResultFolder) -> list[str]:
    """What somebody put among the links to runs."""
    return [key for key in folder.run_keys() if not (folder.runs / key).is_symlink()]
