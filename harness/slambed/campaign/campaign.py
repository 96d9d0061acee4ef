# SPDX-License-Identifier: Apache-2.0
"""`slambed run`: an experiment from its file to its report."""

import hashlib
import math
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from slambed.caller import give_to_caller
from slambed.campaign.choose import choose_engine
from slambed.campaign.cluster import join_cluster, start_on_slurm
from slambed.campaign.datasets import Sequence, prepare_sequence, sensor_of
from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger, utc_now
from slambed.campaign.links import backend_for, open_for_run, read_profile
from slambed.campaign.makers import LiveMaker, Maker, Played
from slambed.campaign.older import settle
from slambed.campaign.order import interleaved
from slambed.campaign.progress import CampaignProgress, duration
from slambed.campaign.remote_link import HelperLinks
from slambed.campaign.runner import Runner, Verdict
from slambed.campaign.workers import WorkerPool
from slambed.data.places import cache_folder
from slambed.engines.docker_image import connect
from slambed.engines.helper import is_root
from slambed.engines.host_lock import host_lock
from slambed.engines.reaper import mark_children, reap
from slambed.engines.virtual import PROGRAM, prune_features
from slambed.errors import MissingDataError, SlambedError, environment_error
from slambed.metrics.collect import keep_groundtruth
from slambed.native import find_program
from slambed.outputs import make_folder
from slambed.report.asked import check_asked
from slambed.spec.device import VIRTUAL
from slambed.spec.experiment import Experiment
from slambed.spec.library import Library
from slambed.spec.matrix import (
    Circumstances,
    Profile,
    RunSpec,
    expand,
    has_cuts,
    needs_link,
    read_profiles,
)
from slambed.spec.software import host_software
from slambed.spec.yaml_source import YamlSource

# Containers, link and start signal, before and after the played time.
OVERHEAD_S = 3.0
# A virtual run takes about this share of the played time; only a first guess for the ETA.
VIRTUAL_SHARE = 0.1


@dataclass
class Options:
    """What the command line may override."""

    runs: int | str | None = None
    engine: str | None = None
    results: Path = Path("results")
    wait: bool = False
    """Wait for another campaign on this host to end."""
    jobs: int | None = None
    """Virtual runs at a time; all CPUs when not given."""
    scheduler: str | None = None
    """Address of a Dask scheduler whose workers make the virtual runs."""
    slurm: bool = False
    """Virtual runs as `jobs` Slurm jobs."""


@dataclass
class Plan:
    """An experiment made definite on this host."""

    experiment: Experiment
    specs: list[RunSpec]
    sequences: dict[str, Sequence]
    circumstances: Circumstances
    left_out: list[str]
    """Datasets that are not here and that the experiment can do without, with what to do."""


def run_experiment(name: str, options: Options, console: Console) -> Verdict:
    """Runs what is missing of an experiment and writes its report.

    Everything that can be wrong with the files is found before anything is started.
    """
    library = Library()
    experiment, source = library.experiment(name)
    count = repetitions(experiment, options.runs)
    asked = options.engine or experiment.engine
    profiles = check(experiment, source, library, asked)
    files = (experiment, source, library, profiles)
    if asked == VIRTUAL:
        return _run_virtually(files, options, count, console)
    if options.scheduler or options.slurm:
        raise SlambedError(
            "--scheduler and --slurm are for virtual runs, a live run takes a whole host: "
            "add --engine virtual"
        )
    check_privilege(asked)
    make_folder(options.results, "--results")
    with host_lock(f"slambed run {experiment.id}", wait_s=math.inf if options.wait else 0.0):
        mark_children()
        if found := str(reap()):
            _say(console, f"removed what a killed campaign left: {found}")
        engine, software = choose_engine(asked, console)
        plan = make_plan(*files, engine.name, software, count)
        open_link = HelperLinks(engine) if engine.unprivileged else open_for_run
        return _run_plan(
            plan, source, options, lambda played: LiveMaker(engine, open_link, played), console
        )


def check_privilege(engine: str) -> None:
    """A live run needs root, or a Docker daemon that listens to us."""
    if is_root():
        return
    refused = "engine local needs root"
    if engine != "local":
        try:
            connect().close()
            return
        except SlambedError as error:
            refused = str(error)
    raise environment_error(
        f"no permission for a live run: not root, and {refused}; run the same command with sudo, "
        "or with --engine virtual, which needs no privilege"
    )


def _run_virtually(
    files: tuple[Experiment, YamlSource, Library, list[Profile]],
    options: Options,
    count: int,
    console: Console,
) -> Verdict:
    """No privilege, no lock on the host: only the result folder is ours alone."""
    program = find_program(PROGRAM)
    features = cache_folder() / "features"
    folder = options.results / files[0].id
    make_folder(folder, "--results")
    with host_lock(
        f"slambed run {files[0].id}",
        folder / ".lock",
        math.inf if options.wait else 0.0,
        f"another campaign writes to {folder}",
    ):
        plan = make_plan(*files, VIRTUAL, host_software(program=PROGRAM), count)
        prune_features(features)

        def maker_of(played: Played) -> Maker:
            if options.scheduler:
                return join_cluster(played, options.scheduler, options.jobs)
            if options.slurm:
                return start_on_slurm(played, options.jobs)
            jobs = options.jobs or len(os.sched_getaffinity(0))
            return WorkerPool(played, program, features, jobs)

        return _run_plan(plan, files[1], options, maker_of, console)


def _run_plan(
    plan: Plan,
    source: YamlSource,
    options: Options,
    maker_of: Callable[[Played], Maker],
    console: Console,
) -> Verdict:
    """Runs what is missing of a plan, then shows the report."""
    experiment, engine = plan.experiment, plan.circumstances.engine
    for line in plan.left_out:
        _say(console, f"left out: {line}")
    folder = ResultFolder(options.results / experiment.id)
    folder.create()
    ledger = Ledger(folder.path / "ledger.jsonl")
    ordered = interleaved(plan.specs, experiment.seed)
    more, moved = settle(folder, ordered)
    if moved:
        _say(console, f"{len(moved)} older runs no longer fit and are now in {folder.stale}")
    todo = [spec for spec in ordered if folder.state(spec.run_key) != "valid"]
    folder.write_json("experiment.json", experiment_json(plan, source, ordered + more))
    ledger.append(
        "campaign_started", runs=len(ordered), todo=[s.run_key for s in todo], command=sys.argv
    )
    for sequence in plan.sequences.values():
        if (truth := sequence.path / "groundtruth.txt").is_file():
            keep_groundtruth(folder.path, sequence.id, truth)
    played = {k: (s.path, s.played_s(experiment.playback)) for k, s in plan.sequences.items()}
    maker = maker_of(played)
    longest_s = max(seconds for _, seconds in played.values())
    run_s = longest_s * VIRTUAL_SHARE if engine == VIRTUAL else longest_s + OVERHEAD_S
    _say(
        console,
        f"{experiment.title}: {len(ordered)} runs, {len(ordered) - len(todo)} there already, "
        f"engine {engine}, about {duration(run_s * len(todo) / maker.jobs)}",
    )
    try:
        with CampaignProgress(console, len(todo), run_s, maker.jobs) as progress:
            verdict = Runner(folder, ledger, maker).run(todo, progress)
        ledger.append("campaign_ended", done=verdict.done, interrupted=verdict.interrupted)
        if any(folder.state(spec.run_key) != "missing" for spec in ordered):
            show_report(folder.path, console, anew=verdict.done > 0)
    finally:
        give_to_caller(folder.path)
    return verdict


def show_report(folder: Path, console: Console, anew: bool = True) -> None:
    """Shows the tables of a result folder and writes its report, unless it is there already."""
    from slambed.report.experiment import terminal_summary, write_report

    if anew or not (folder / "report" / "index.html").exists():
        write_report(folder)
    terminal_summary(folder, console)
    _say(console, f"every run: {folder / 'summary.csv'}")


def repetitions(experiment: Experiment, asked: int | str | None) -> int:
    """Runs per cell: a number, `paper`, or what the experiment says."""
    if asked is None or asked == "default":
        return experiment.runs.default
    if asked == "paper":
        if experiment.runs.paper is None:
            raise SlambedError(f"experiment {experiment.id} has no runs.paper; give a number")
        return experiment.runs.paper
    if (isinstance(asked, int) or asked.isdigit()) and (count := int(asked)) >= 1:
        return count
    raise SlambedError(f"--runs {asked} is neither a number above 0 nor 'paper' nor 'default'")


def check(
    experiment: Experiment, source: YamlSource, library: Library, engine: str = ""
) -> list[Profile]:
    """Finds what is wrong with an experiment without preparing or starting anything."""
    check_asked(experiment, source)
    profiles = read_profiles(experiment, source, read_profile)
    _expand_unprepared(experiment, source, library, profiles, engine)
    for index, name in enumerate(experiment.datasets):
        try:
            sensor = sensor_of(name)
        except SlambedError as error:
            raise _of_dataset(error, source, index) from None
        _check_sensor(sensor, experiment, source, library, index)
    return profiles


def planned_runs(experiment: Experiment, source: YamlSource, library: Library) -> int:
    """How many runs an experiment stands for where all its datasets are."""
    profiles = read_profiles(experiment, source, read_profile)
    cells = _expand_unprepared(experiment, source, library, profiles, experiment.engine)
    return len(cells) * repetitions(experiment, None)


def _expand_unprepared(
    experiment: Experiment,
    source: YamlSource,
    library: Library,
    profiles: list[Profile],
    engine: str,
) -> list[RunSpec]:
    """The first run of every cell, before anything is known of datasets and host."""
    # Not prepared yet: its name stands for its content.
    nowhere = {name: (name, name) for name in experiment.datasets}
    anyhow = {profile.name: "" for profile in profiles}
    engine = VIRTUAL if engine == VIRTUAL else ""
    host = Circumstances(engine, anyhow, "", nowhere)
    return expand(experiment, source, library, profiles, host, runs=1)


def _of_dataset(error: SlambedError, source: YamlSource, index: int) -> SlambedError:
    line = source.line_of(("datasets", index))
    return SlambedError(f"{error} ({source.path} line {line})", error.code)


def _check_sensor(
    sensor: str, experiment: Experiment, source: YamlSource, library: Library, index: int
) -> None:
    """Every system must play what the dataset was recorded with."""
    for choice in experiment.systems:
        sensors = library.system(choice.system).sensors
        if sensor not in sensors:
            raise source.complaint(
                f"dataset {experiment.datasets[index]} is {sensor}, system {choice.system} plays "
                + " and ".join(sensors),
                ("datasets", index),
            )


def make_plan(
    experiment: Experiment,
    source: YamlSource,
    library: Library,
    profiles: list[Profile],
    engine: str,
    software: str,
    count: int,
) -> Plan:
    """Prepares the datasets and expands the matrix."""
    sequences: dict[str, Sequence] = {}
    names: dict[str, tuple[str, str]] = {}
    played_s: dict[str, float] = {}
    left_out: list[str] = []
    for index, name in enumerate(experiment.datasets):
        try:
            sequence = prepare_sequence(name)
            played_s[name] = sequence.played_s(experiment.playback)
        except SlambedError as error:
            if isinstance(error, MissingDataError) and experiment.missing_datasets == "skip":
                left_out.append(str(error))
                continue
            raise _of_dataset(error, source, index) from None
        _check_sensor(sequence.sensor, experiment, source, library, index)
        sequences[sequence.id] = sequence
        names[name] = (sequence.id, sequence.checksum)
    if not sequences:
        raise SlambedError(f"no dataset of {source.path} is on this machine: {left_out[0]}")
    backends: dict[str, str] = {}
    if experiment.link is not None and needs_link(experiment, library):
        asked = experiment.link.backend
        backends = {p.name: VIRTUAL for p in profiles}
        if engine != VIRTUAL:
            cut = has_cuts(experiment)
            backends = {p.name: backend_for(asked, p, cut) for p in profiles}
    circumstances = Circumstances(engine, backends, software, names, played_s)
    specs = expand(experiment, source, library, profiles, circumstances, count)
    return Plan(experiment, specs, sequences, circumstances, left_out)


def experiment_json(plan: Plan, source: YamlSource, ordered: list[RunSpec]) -> dict[str, Any]:
    """The experiment as run: the file's content, what the host decided, every run in its order."""
    return {
        "experiment": plan.experiment.model_dump(mode="json"),
        "file": {
            "name": source.path.name,
            "sha256": hashlib.sha256(source.path.read_bytes()).hexdigest(),
        },
        "engine": plan.circumstances.engine,
        "link_backends": dict(plan.circumstances.link_backends),
        "software": plan.circumstances.software,
        "written_utc": utc_now(),
        "runs": [{"run_key": s.run_key, **s.model_dump(mode="json")} for s in ordered],
    }


def _say(console: Console, line: str) -> None:
    console.print(line, highlight=False, markup=False, soft_wrap=True)
