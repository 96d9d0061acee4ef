# SPDX-License-Identifier: Apache-2.0
"""What of an experiment is there, what is missing or stale, and why."""

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from slambed.campaign.campaign import planned_runs
from slambed.campaign.folder import ResultFolder, read_object
from slambed.campaign.older import spec_of
from slambed.errors import SlambedError
from slambed.spec.library import Library
from slambed.spec.matrix import RunSpec


@dataclass
class CellStatus:
    """Runs of one cell."""

    cell: str
    valid: int = 0
    invalid: list[str] = field(default_factory=list)
    """Why, one line per run."""
    missing: int = 0


@dataclass
class Status:
    """Runs of an experiment as it was last expanded."""

    cells: list[CellStatus]
    stale: list[str]
    """Run folders that belong to no run of the experiment any more, and what differs."""
    notes: list[str]

    @property
    def complete(self) -> bool:
        """True when every run is there and valid."""
        return all(not cell.missing and not cell.invalid for cell in self.cells)


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
    try:
        content = json.loads((folder.path / "experiment.json").read_text())
        specs = [RunSpec.model_validate(_without_key(run)) for run in content["runs"]]
    except (OSError, ValueError, KeyError, TypeError):
        raise SlambedError(
            f"{folder.path / 'experiment.json'} is missing or not whole; "
            f"'slambed run {name}' writes it anew"
        ) from None
    cells: dict[str, CellStatus] = {}
    for spec in specs:
        cell = cells.setdefault(spec.cell, CellStatus(spec.cell))
        match folder.state(spec.run_key):
            case "valid":
                cell.valid += 1
            case "invalid":
                summary = folder.read(spec.run_key, "summary.json") or {}
                cell.invalid.append(f"{spec.run_key}: {summary.get('invalid_reason')}")
            case _:
                cell.missing += 1
    notes: list[str] = []
    if yaml_path is not None and yaml_path.is_file():
        digest = hashlib.sha256(yaml_path.read_bytes()).hexdigest()
        if digest != content.get("file", {}).get("sha256"):
            notes.append(f"{yaml_path.name} has changed since; 'slambed run' takes the new one")
    if software and content.get("software") not in software:
        notes.append("the C++ sources have changed since: 'slambed run' would make every run anew")
    return Status(list(cells.values()), _stale(folder, specs), notes)


def _without_key(run: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in run.items() if key != "run_key"}


def _stale(folder: ResultFolder, specs: list[RunSpec]) -> list[str]:
    wanted = {spec.run_key for spec in specs}
    lines = [
        f"{key}: not a run of this experiment, in {folder.runs}"
        for key in folder.run_keys()
        if key not in wanted
    ]
    for path in sorted(folder.stale.glob("*")):
        manifest = read_object(path / "manifest.json")
        lines.append(f"{path.name}: {_difference(manifest, specs)}, in {folder.stale}")
    return lines


def _difference(manifest: dict[str, Any] | None, specs: list[RunSpec]) -> str:
    """Against the run with the same cell and repetition."""
    if (old := spec_of(manifest)) is None:
        return "made by another version of slambed"
    for spec in specs:
        if (spec.cell, spec.repetition) == (old.cell, old.repetition):
            now, then = spec.meaning(), old.meaning()
            changed = [name for name in now if now[name] != then[name]]
            return f"{old.run_name}, other {', '.join(changed)}"
    return f"{old.run_name} is not part of the experiment any more"
