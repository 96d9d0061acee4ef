# SPDX-License-Identifier: Apache-2.0
"""Plays runs of a results folder again, drawn at random, and compares what came out: anybody can
check packed virtual runs of others."""

import random
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from rich.console import Console

from slambed.campaign.options import Options
from slambed.campaign.run_experiment import run_experiment
from slambed.campaign.size import planned
from slambed.campaign.store import RunStore
from slambed.errors import SlambedError
from slambed.files.json_file import object_or_empty
from slambed.metrics.collect import SOME_EVENTS, events_file, types_kept, write_some_events
from slambed.native import SIMULATION
from slambed.spec.device import VIRTUAL
from slambed.spec.software import host_software, software_of_systems

NOT_COMPARED = ("manifest.json", "log.txt")
"""Files that say when and where a run was played, and with which command."""


@dataclass(frozen=True)
class Drawn:
    """A run that is played again."""

    experiment: str
    run_key: str
    cell: str
    system: str
    repetition: int
    seed: int
    software: str

    def __str__(self) -> str:
        return f"{self.run_key} ({self.experiment}, {self.cell}, seed {self.seed})"


@dataclass
class Replayed:
    """What came out of runs that were played again."""

    same: list[Drawn] = field(default_factory=list)
    files: int = 0
    """Number of files that were equal, of all runs."""
    different: dict[Drawn, list[str]] = field(default_factory=dict)
    """Run -> its files that differ or are missing."""
    left_out: dict[Drawn, str] = field(default_factory=dict)
    """Run -> why there is nothing to compare with."""
    interrupted: bool = False


def draw(results: Path, names: list[str], count: int, seed: int) -> list[Drawn]:
    """Returns `count` valid virtual runs of these experiments, or all if there are fewer, sorted
    by experiment. The same runs and seed give the same draw.

    Raises SlambedError for an unknown experiment, or if there is no such run.
    """
    plans = dict(planned(results))
    if missing := [name for name in names if name not in plans]:
        known = ", ".join(plans) or "none"
        raise SlambedError(f"no results of {', '.join(missing)} in {results}; there are: {known}")
    store = RunStore(results)
    runs = {run["run_key"]: (name, run) for name in names for run in plans[name]}
    there = [
        key
        for key, (_, run) in sorted(runs.items())
        if run.get("engine") == VIRTUAL and store.state(key) == "valid"
    ]
    if not there:
        raise SlambedError(f"no valid virtual run of {', '.join(names)} in {results}")
    keys = random.Random(seed).sample(there, min(count, len(there)))
    return sorted((_drawn(*runs[key]) for key in keys), key=lambda d: (d.experiment, d.run_key))


def _drawn(experiment: str, run: dict[str, Any]) -> Drawn:
    text = {key: str(run.get(key)) for key in ("run_key", "cell", "system", "software")}
    return Drawn(experiment, repetition=run["repetition"], seed=run["seed"], **text)


def replay(
    results: Path,
    drawn: list[Drawn],
    files: dict[str, str],
    settings: list[str],
    jobs: int | None,
    console: Console,
) -> Replayed:
    """Plays the runs again, into a folder that is removed, and compares every file that `results`
    has of them.

    `files`: experiment -> its name or file, where that is another one. `settings`: as for `slambed
    run`. Runs of other sources than those here are not played.
    """
    found = Replayed()
    here = host_software(program=SIMULATION)
    ours = software_of_systems(here, {run.system for run in drawn})
    with tempfile.TemporaryDirectory(prefix="slambed-replay.") as place:
        for experiment, group in groupby(drawn, key=lambda run: run.experiment):
            runs = list(group)
            for run in runs:
                if run.software != (tag := ours.get(run.system, here)):
                    found.left_out[run] = f"made by {run.software}, here is {tag}"
            runs = [run for run in runs if run not in found.left_out]
            if not runs:
                continue
            options = Options(
                max(run.repetition for run in runs) + 1,
                VIRTUAL,
                Path(place),
                jobs=jobs,
                settings=settings,
                keep_going=True,
                keys=frozenset(run.run_key for run in runs),
            )
            outcome = run_experiment(files.get(experiment, experiment), options, console)
            if outcome.interrupted:
                found.interrupted = True
                return found
            for run in runs:
                _judge(found, run, RunStore(results), RunStore(Path(place)), outcome.given_up)
    return found


def _judge(
    found: Replayed, run: Drawn, before: RunStore, after: RunStore, given_up: dict[str, str]
) -> None:
    if after.state(run.run_key) == "missing":
        why = "its experiment plans no such run here: other settings or inputs"
        found.left_out[run] = given_up.get(run.run_key, why)
        return
    old, new = before.runs / run.run_key, after.runs / run.run_key
    names = list(_names(old))
    if different := [name for name in names if not _equal(old / name, new / name)]:
        found.different[run] = different
        return
    found.same.append(run)
    found.files += len(names)


def _names(folder: Path) -> Iterator[str]:
    """Yields the files of a run that are compared."""
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        if path.is_file() and path.name not in NOT_COMPARED and name.parts[0] != "pictures":
            yield name.as_posix()


def _equal(old: Path, new: Path) -> bool:
    if old.name == SOME_EVENTS and not new.exists():
        types = types_kept(old)
        events = events_file(new.parent, types)
        if events is None:
            return False
        write_some_events(events, types, new)
    if not new.is_file():
        return False
    if old.read_bytes() == new.read_bytes():
        return True
    # Files that other versions of the libraries wrote differ in bytes and not in content.
    if old.suffix == ".json":
        return object_or_empty(old) == object_or_empty(new) != {}
    if old.suffix == ".parquet":
        try:
            return bool(pq.read_table(old).equals(pq.read_table(new)))
        except (OSError, pa.ArrowException):
            return False
    return False
