# SPDX-License-Identifier: Apache-2.0
"""Plays runs of a results folder again, drawn at random, and compares what came out: anybody can
check packed virtual runs of others."""

import math
import random
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any, Literal

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
from slambed.spec.library import Library
from slambed.spec.software import host_software, software_of_systems

NOT_COMPARED = ("manifest.json", "log.txt")
"""Files that say when and where a run was played, and with which command."""
RUN_BY = "experiment"
"""Key of summary.json that is not compared: of several experiments with a run, the first one."""
NOT_PLANNED = (
    "its experiment plans no such run here: other settings or inputs, such as a recording that is "
    "not here"
)
LAST_DIGITS = 1e-9
"""Relative difference up to which numbers of a summary count as equal. Processors differ in the
last digits of accuracies (docs/explanation/virtual-time.md)."""


@dataclass(frozen=True)
class Drawn:
    """A run that is played again."""

    experiment: str
    run_key: str
    cell: str
    system: str
    dataset: str
    """Name of its dataset in the experiment's file."""
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
    digits: int = 0
    """Number of runs among `same` whose accuracies have other last digits."""
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
    runs = {run["run_key"]: (name, run) for name in names for run in plans[name] if _is_whole(run)}
    there = [
        key
        for key, (_, run) in sorted(runs.items())
        if run["engine"] == VIRTUAL and store.state(key) == "valid"
    ]
    if not there:
        raise SlambedError(f"no valid virtual run of {', '.join(names)} in {results}")
    keys = random.Random(seed).sample(there, min(count, len(there)))
    names_of = {name: _names_of_datasets(results / name) for name in names}
    drawn = [_drawn(name, run, names_of[name]) for name, run in map(runs.__getitem__, keys)]
    return sorted(drawn, key=lambda run: (run.experiment, run.run_key))


TEXT = ("run_key", "cell", "system", "dataset", "software", "engine")
NUMBERS = ("repetition", "seed")


def _is_whole(run: dict[str, Any]) -> bool:
    """Returns whether a run of a plan has what a replay needs; without it nobody can find it."""
    return all(isinstance(run.get(key), str) for key in TEXT) and all(
        isinstance(run.get(key), int) for key in NUMBERS
    )


def _names_of_datasets(folder: Path) -> dict[str, str]:
    """Returns sequence -> the name of its dataset in the experiment's file."""
    datasets = object_or_empty(folder / "experiment.json").get("datasets")
    named = datasets.items() if isinstance(datasets, dict) else ()
    return {str(sequence): name for name, sequence in named}


def _drawn(experiment: str, run: dict[str, Any], names_of: dict[str, str]) -> Drawn:
    return Drawn(
        experiment,
        run["run_key"],
        run["cell"],
        run["system"],
        names_of.get(run["dataset"], run["dataset"]),
        run["repetition"],
        run["seed"],
        run["software"],
    )


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

    Raises SlambedError for an experiment that is not known here, before anything is played.
    """
    library = Library()
    datasets = {
        name: library.experiment(files.get(name, name), settings)[0].datasets
        for name in dict.fromkeys(run.experiment for run in drawn)
    }
    found = Replayed()
    here = host_software(program=SIMULATION)
    ours = software_of_systems(here, {run.system for run in drawn})
    with tempfile.TemporaryDirectory(prefix="slambed-replay.") as place:
        for experiment, group in groupby(drawn, key=lambda run: run.experiment):
            runs = list(group)
            for run in runs:
                if run.software != (tag := ours.get(run.system, here)):
                    found.left_out[run] = f"made by {run.software}, here is {tag}"
                elif run.dataset not in datasets[experiment]:
                    found.left_out[run] = NOT_PLANNED
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
                datasets=frozenset(run.dataset for run in runs),
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
        found.left_out[run] = given_up.get(run.run_key, NOT_PLANNED)
        return
    old, new = before.runs / run.run_key, after.runs / run.run_key
    compared = {name: _compare(old / name, new / name) for name in _names(old)}
    if different := [name for name, result in compared.items() if result == "different"]:
        found.different[run] = different
        return
    found.same.append(run)
    found.files += len(compared)
    found.digits += "digits" in compared.values()


def _names(folder: Path) -> Iterator[str]:
    """Yields the files of a run that are compared."""
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        if path.is_file() and path.name not in NOT_COMPARED and name.parts[0] != "pictures":
            yield name.as_posix()


def _compare(old: Path, new: Path) -> Literal["same", "digits", "different"]:
    if old.name == SOME_EVENTS and not new.exists():
        types = types_kept(old)
        events = events_file(new.parent, types)
        if events is None:
            return "different"
        write_some_events(events, types, new)
    if not new.is_file():
        return "different"
    if old.read_bytes() == new.read_bytes():
        return "same"
    if old.suffix == ".json":
        ours, theirs = object_or_empty(old), object_or_empty(new)
        if old.name == "summary.json":
            ours.pop(RUN_BY, None)
            theirs.pop(RUN_BY, None)
        if ours and ours == theirs:
            return "same"
        return "digits" if _is_close(ours, theirs) else "different"
    if old.suffix == ".parquet":
        # Another version of the library writes the same table in other bytes.
        try:
            return "same" if pq.read_table(old).equals(pq.read_table(new)) else "different"
        except (OSError, pa.ArrowException):
            return "different"
    return "different"


def _is_close(a: Any, b: Any) -> bool:
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_is_close(a[key], b[key]) for key in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(_is_close, a, b))
    if isinstance(a, float) and isinstance(b, float):
        return math.isclose(a, b, rel_tol=LAST_DIGITS)
    return type(a) is type(b) and bool(a == b)
