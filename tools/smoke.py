# SPDX-License-Identifier: Apache-2.0
"""Plays three seconds of experiments in virtual time: see smoke.sh.

    smoke.py FOLDER [all | EXPERIMENT ...]

Without names it plays a few experiments that cover every system.

An experiment is only shortened: one cell per system, the last one that the virtual engine can play,
on every dataset of a bare checkout, with faults moved to the beginning. Streets are rendered small.
A prior map is made from the same three seconds.
"""

import contextlib
import dataclasses
import io
import os
import signal
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import yaml

from slambed.commands.main import run_command
from slambed.data.catalog import Catalog
from slambed.errors import SlambedError
from slambed.spec.input_recipe import YIELDED
from slambed.spec.inputs import FROM_DATASET
from slambed.spec.library import Library

SECONDS, FPS = 3.0, 10.0
SLACK_S = 0.3
"""Makes sure that the last frame before SECONDS is in the sequence."""
LIMIT_S = 600
"""Far longer than an experiment takes; one that hangs fails."""
FAULT_AT_S, FAULT_FOR_S = 1.0, 1.0
LIVE_ONLY = ("kill", "restart")
STREETS = ("rectangle", "circular", "block")
STREET_SIZE = {"width": 320, "height": 180}


def short_catalog() -> Catalog:
    """Returns the catalog of a bare checkout with all generated datasets shortened to SECONDS."""
    shipped = Catalog.load(search=[])
    datasets = {}
    for name, dataset in shipped.datasets.items():
        if dataset.synthetic is not None:
            changed = {"seconds": SECONDS + SLACK_S}
            if dataset.synthetic.trajectory in STREETS:
                changed |= STREET_SIZE
            options = dataset.synthetic.model_copy(update=changed)
            dataset = dataset.model_copy(update={"synthetic": options, "fps": FPS})
        datasets[name] = dataset
    return dataclasses.replace(shipped, datasets=datasets)


def cut(experiment: dict[str, Any], sequences: dict[str, str]) -> dict[str, Any]:
    """Returns the experiment's file with one cell per system and dataset, and three seconds.
    `sequences`: dataset as the file names it -> folder."""
    common = experiment.get("faults", [])

    def is_virtual(choice: dict[str, Any]) -> bool:
        return not any(fault.get("edge") in LIVE_ONLY for fault in choice.get("faults", common))

    # Keep the last entry of each system, because a report may need a metric that only it measures.
    choices = list({c["system"]: dict(c) for c in experiment["systems"] if is_virtual(c)}.values())
    folders = list(dict.fromkeys(sequences.values()))
    short = experiment | {"systems": choices, "datasets": folders, "engine": "virtual"}
    for choice in choices:
        if "datasets" in choice:
            own = [sequences[name] for name in choice["datasets"] if name in sequences]
            choice["datasets"] = list(dict.fromkeys(own))
    for place in (short, *choices):
        if "faults" in place:
            place["faults"] = [early(fault) for fault in place["faults"]]
    if "link" in experiment:
        known = [p if isinstance(p, str) else p["name"] for p in experiment["link"]["profiles"]]
        for choice in choices:
            choice["profiles"] = choice.get("profiles", known)[-1:]
    playback = experiment.get("playback", {}) | {"start_s": 0, "end_s": SECONDS}
    return short | {"playback": playback}


def wants_prior_map(experiment: dict[str, Any]) -> bool:
    """Returns whether a system uses the prior map of its dataset."""
    return any(
        FROM_DATASET in choice.get("params", {}).values() for choice in experiment["systems"]
    )


def with_prior_map(experiment: dict[str, Any], sequence: str, place: Path) -> dict[str, Any]:
    """Returns the experiment on one sequence, with a prior map from a run on the same sequence."""
    maker = {
        "id": f"map_{experiment['id']}", "title": "A prior map",
        "systems": [{"system": "orbslam2", "params": {"save_map": True, "n_orb": 2000}}],
        "datasets": [sequence], "playback": {"mode": "every_frame", "end_s": SECONDS},
        "devices": {"mobile": "host"}, "engine": "virtual", "runs": {"default": 1},
    }  # fmt: skip
    results = place / maker["id"]
    if complaint := executed(maker, place, results):
        raise SlambedError(f"prior map: {complaint}")
    (made,) = results.rglob(YIELDED["map"])
    choices = [
        choice
        | {
            "params": {
                n: str(made) if v == FROM_DATASET else v for n, v in choice["params"].items()
            }
        }
        for choice in experiment["systems"]
    ]
    return experiment | {"systems": choices, "datasets": [sequence]}


def early(fault: dict[str, Any]) -> dict[str, Any]:
    """Moves a fault into the three seconds."""
    return fault | {"at_s": FAULT_AT_S} | ({"for_s": FAULT_FOR_S} if "for_s" in fault else {})


def play(name: str, catalog: Catalog, place: Path) -> str:
    """Plays one experiment. Returns one line that says what is wrong, or an empty string."""
    library = Library()
    experiment, source = library.experiment(name)
    datasets = {name: catalog.resolve(name) for name in experiment.datasets}
    here = {name: dataset.id for name, dataset in datasets.items() if catalog.available(dataset)}
    try:
        folders = {key: str(catalog.prepare(key).path) for key in dict.fromkeys(here.values())}
    except SlambedError as error:
        return str(error)
    if not folders:
        return "nothing to play in a bare checkout"
    short = cut(source.data, {name: folders[key] for name, key in here.items()})
    signal.signal(signal.SIGALRM, not_over)
    signal.alarm(LIMIT_S)
    try:
        if wants_prior_map(short):
            short = with_prior_map(short, next(iter(folders.values())), place)
        return executed(short, place, place / "results")
    except SlambedError as error:
        return str(error)
    finally:
        signal.alarm(0)


def executed(experiment: dict[str, Any], place: Path, results: Path) -> str:
    """Executes an experiment once. Returns one line that says what is wrong, or an empty string."""
    file = place / f"{experiment['id']}.yaml"
    file.write_text(yaml.safe_dump(experiment, sort_keys=False))
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        # No figures: the tests of reports cover them, and a figure cannot fail a campaign.
        code = run_command(
            [
                "run",
                str(file),
                "--engine",
                "virtual",
                "--runs",
                "1",
                "--jobs",
                "1",
                "--no-figures",
                "--results",
                str(results),
            ]
        )
    lines = [line for line in output.getvalue().splitlines() if line.strip()]
    return f"exit code {code}: {lines[-1] if lines else 'no output'}" if code else ""


def not_over(number: int, frame: FrameType | None) -> NoReturn:
    """Ends a command that hangs."""
    raise TimeoutError(f"not over after {LIMIT_S} s")


def one_per_system(library: Library, catalog: Catalog) -> list[str]:
    """Returns a few experiments that cover all systems, greedily the one with most new systems."""
    plays: dict[str, set[str]] = {}
    for name in library.experiments():
        experiment, source = library.experiment(name)
        if any(catalog.available(catalog.resolve(dataset)) for dataset in experiment.datasets):
            choices = cut(source.data, {})["systems"]
            plays[name] = {choice["system"] for choice in choices}
    left, chosen = set().union(*plays.values()), []
    while left:
        chosen.append(max(plays, key=lambda name: len(plays[name] & left)))
        left -= plays[chosen[-1]]
    return chosen


def main() -> int:
    place, names = Path(sys.argv[1]), sys.argv[2:]
    catalog = short_catalog()
    if not names:
        names = one_per_system(Library(), catalog)
    elif names == ["all"]:
        names = Library().experiments()
    began = time.monotonic()
    # One process per CPU, so that modules are loaded only once per process.
    with ProcessPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        reported = pool.map(partial(play, catalog=catalog, place=place), names)
        results = dict(zip(names, reported, strict=True))
    bad = {name: line for name, line in results.items() if line}
    for name, line in bad.items():
        print(f"error: smoke, {name}: {line}", file=sys.stderr)
    took_s = time.monotonic() - began
    print(f"smoke: {len(names) - len(bad)} of {len(names)} experiments ran, {took_s:.0f} s")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
