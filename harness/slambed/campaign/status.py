# SPDX-License-Identifier: Apache-2.0
"""Which runs of an experiment exist, are missing or outdated, and why."""

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from slambed.campaign.folder import ResultFolder
from slambed.campaign.plan import planned_runs
from slambed.campaign.plan_as_it_is import plan_as_it_is
from slambed.errors import SlambedError
from slambed.files.json_file import read_object
from slambed.metrics.summary import Summary
from slambed.spec.library import Library
from slambed.spec.run_spec import RunSpec


@dataclass
class CellStatus:
    """Runs of one cell."""

    cell: str
    valid: int = 0
    invalid: list[str] = field(default_factory=list)
    """Reasons, one line per run."""
    missing: int = 0


@dataclass
class Status:
    """Runs of an experiment: as last executed, or according to its current file."""

    cells: list[CellStatus]
    notes: list[str]
    known: bool = True
    """False if there is nothing to count or the counts are unknown; the notes explain why."""

    @property
    def complete(self) -> bool:
        """True when every run exists and is valid."""
        return self.known and all(not cell.missing and not cell.invalid for cell in self.cells)


def was_run(results: Path, name: str) -> bool:
    """Returns whether a campaign has at least begun."""
    folder = ResultFolder(results / name)
    return (folder.path / "experiment.json").exists() or bool(folder.run_keys())


def is_of(results: Path, name: str, file: Path) -> bool:
    """Returns whether the results belong to the current file; also true if that was not
    recorded."""
    content = read_object(results / name / "experiment.json") or {}
    known = content.get("file", {}).get("sha256")
    return known is None or known == _digest(file)


def status_now(results: Path, name: str, given: str) -> Status:
    """Returns what `slambed run` would find for the current file, by the keys of its plan,
    whichever experiment executed the runs. Raises SlambedError for a mistake in the file."""
    library = Library()
    experiment, source = library.experiment(given)
    folder = ResultFolder(results / name)
    before = was_run(results, name)
    begun = f"{source.path.name} has changed since it was run" if before else "not run yet"
    # Missing datasets are only found during the campaign.
    most = "at most " if experiment.missing_datasets == "skip" else ""
    count = f"{most}{planned_runs(experiment, source, library)} runs"
    start = f"start with 'slambed run {given}'"
    if not folder.store.keys():
        return Status([], [f"{begun}: 0 of {count}; {start}"], known=False)
    try:
        plan = plan_as_it_is(experiment, source, library)
    except SlambedError as error:
        message = f"{begun}: which of {count} are there is not known ({error})"
        more = f"'slambed run {given} --dry-run' makes what is missing and says"
        return Status([], [f"{message}; {more}"], known=False)
    cells = cells_of(plan.specs, folder)
    there = sum(cell.valid + len(cell.invalid) for cell in cells)
    notes = [f"{begun}: {there} of {len(plan.specs)} runs; {start}"]
    notes += [f"left out: {line}" for line in plan.left_out]
    if there and not before:
        notes.append("other experiments asked for the same runs; 'slambed run' takes them")
    return Status(cells if there or before else [], notes, known=bool(there or before))


def cells_of(specs: list[RunSpec], folder: ResultFolder) -> list[CellStatus]:
    """Returns the state of these runs as a campaign would find them."""
    cells: dict[str, CellStatus] = {}
    for spec in specs:
        cell = cells.setdefault(spec.cell, CellStatus(spec.cell))
        match folder.state(spec.run_key):
            case "valid":
                cell.valid += 1
            case "invalid":
                summary = folder.summary(spec.run_key) or Summary()
                cell.invalid.append(f"{spec.run_key}: {summary.get('invalid_reason')}")
            case _:
                cell.missing += 1
    return list(cells.values())


def status_of(results: Path, name: str, yaml_path: Path | None, software: set[str]) -> Status:
    """Compares experiment.json with the run folders. `software`: tags of software that would run
    now."""
    folder = ResultFolder(results / name)
    content = read_object(folder.path / "experiment.json") or {}
    try:
        specs = [RunSpec.model_validate(_without_key(run)) for run in content["runs"]]
    except (ValueError, KeyError, TypeError):
        raise SlambedError(
            f"{folder.path / 'experiment.json'} is missing or not whole; "
            f"'slambed run {name}' writes it anew"
        ) from None
    cells = cells_of(specs, folder)
    notes = [f"{key}: not a run of this experiment, in {folder.runs}" for key in _foreign(folder)]
    file = yaml_path if yaml_path is not None and yaml_path.is_file() else None
    if file is not None and _digest(file) != content.get("file", {}).get("sha256"):
        notes.append(f"{file.name} has changed since; 'slambed run' takes the new one")
    if software and content.get("software") not in software:
        notes.append(
            "C++ sources have changed since: 'slambed run' executes the runs of the systems that "
            "link them; what is there stays"
        )
    return Status(cells, notes)


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _without_key(run: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in run.items() if key != "run_key"}


def _foreign(folder: ResultFolder) -> list[str]:
    """Returns entries among the run links that are not links."""
    return [key for key in folder.run_keys() if not (folder.runs / key).is_symlink()]
