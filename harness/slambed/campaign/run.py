# SPDX-License-Identifier: Apache-2.0
"""`slambed run`: executes what is missing of an experiment."""

import math
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from rich.console import Console

from slambed.caller import give_to_caller
from slambed.campaign.cluster import join_cluster, start_on_slurm
from slambed.campaign.executors import Executor, Played
from slambed.campaign.folder import ResultFolder
from slambed.campaign.further import further_repetitions
from slambed.campaign.ledger import Ledger
from slambed.campaign.order import interleaved
from slambed.campaign.plan import Plan, check, experiment_json, make_plan, notes, repetitions
from slambed.campaign.prepared_inputs import prepare_input
from slambed.campaign.preview import chosen, preview
from slambed.campaign.processes import ProcessExecutor
from slambed.campaign.progress import CampaignProgress, duration
from slambed.campaign.runner import DEFAULT_RETRIES, Runner, Verdict, stop_on_signal
from slambed.campaign.store import ATTEMPTS, STORE
from slambed.data.places import cache_folder
from slambed.engines.host_lock import host_lock
from slambed.engines.virtual import prune_features
from slambed.errors import SlambedError
from slambed.json_file import object_or_empty
from slambed.metrics.collect import keep_groundtruth
from slambed.native import SIMULATION, find_program
from slambed.outputs import make_folder
from slambed.spec.device import VIRTUAL
from slambed.spec.experiment import Experiment
from slambed.spec.library import Library
from slambed.spec.matrix import NamedProfile
from slambed.spec.run_spec import RunSpec
from slambed.spec.software import host_software
from slambed.yaml_source import YamlSource

# Containers, link and start signal, before and after the played time.
OVERHEAD_S = 3.0
# A virtual run takes about this share of the played time; only a first guess for the ETA.
VIRTUAL_SHARE = 0.1
RESERVED = (STORE, ATTEMPTS, "papers", "inference", "bisect")
"""Folders of `results/` that are no experiments."""

Files = tuple[Experiment, YamlSource, Library, list[NamedProfile]]
"""An experiment with what was read for it."""


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
    """Address of a Dask scheduler whose workers execute the virtual runs."""
    slurm: bool = False
    """Virtual runs as `jobs` Slurm jobs."""
    retries: int = DEFAULT_RETRIES
    """Further attempts of a run that is not to be trusted."""
    quiet_within_min: float = 0.0
    """How long to wait for the host to become quiet before live runs."""
    settings: list[str] = field(default_factory=list)
    """`key=value`, instead of what the experiment's file says."""
    only: list[str] = field(default_factory=list)
    """Cells to execute, patterns included; all where none is named."""
    force: list[str] = field(default_factory=list)
    """Cells, patterns included, whose runs are executed again although they are there."""
    keep_going: bool = False
    """Runs that have to be given up do not end the campaign."""
    dry_run: bool = False
    """Tell what would be executed, and execute nothing."""
    plans: dict[str, dict[str, str]] = field(default_factory=dict)
    """The papers' plans of this moment, for the manifests of what is executed."""


def run_experiment(name: str, options: Options, console: Console) -> Verdict:
    """Executes what is missing of an experiment into `results/<its id>`.

    Everything that can be wrong with the files is found before anything is started.
    """
    library = Library()
    experiment, source = library.experiment(name, options.settings)
    if experiment.id in RESERVED:
        raise source.complaint(f"no experiment may be called '{experiment.id}'", ("id",))
    count = repetitions(experiment, options.runs)
    asked = options.engine or experiment.engine
    profiles = check(experiment, source, library, asked)
    files = (experiment, source, library, profiles)
    if asked == VIRTUAL:
        return _run_virtually(files, options, count, console)
    return _run_live(files, asked, options, count, console)


def _provider(library: Library, console: Console) -> Callable[[str], Path]:
    return lambda name: prepare_input(name, library, partial(_say, console)).file


def _run_live(files: Files, asked: str, options: Options, count: int, console: Console) -> Verdict:
    """On this host, which is ours alone meanwhile."""
    # Containers and links take half a second to load, which virtual runs do not need.
    from slambed.campaign.choose import check_privilege, choose_engine
    from slambed.campaign.foreign import software_of_foreign
    from slambed.campaign.live_executor import LiveExecutor
    from slambed.campaign.quiet import wait_for_quiet
    from slambed.campaign.remote_link import HelperLinks
    from slambed.campaign.run_link import open_for_run
    from slambed.engines.reaper import mark_children, reap

    experiment, source, library, _ = files
    if options.scheduler or options.slurm:
        raise SlambedError(
            "--scheduler and --slurm are for virtual runs, a live run takes a whole host: "
            "add --engine virtual"
        )
    check_privilege(asked)
    if not options.dry_run:
        make_folder(options.results, "--results")
    with host_lock(f"slambed run {experiment.id}", wait_s=math.inf if options.wait else 0.0):
        mark_children()
        if found := str(reap()):
            _say(console, f"removed what a killed campaign left: {found}")
        engine, software = choose_engine(asked, console)
        foreign = software_of_foreign(experiment, library, engine, software)
        provide = _provider(library, console)
        plan = make_plan(
            *files,
            engine.name,
            software,
            count,
            provide,
            foreign=foreign,
            say=partial(_say, console),
        )
        open_link = HelperLinks(engine) if engine.unprivileged else open_for_run

        def executor_of(played: Played) -> Executor:
            with stop_on_signal() as stop:
                limit_s = 60.0 * options.quiet_within_min
                wait_for_quiet(limit_s, stop, partial(_say, console))
            return LiveExecutor(engine, open_link, played)

        return _run_plan(plan, source, options, executor_of, console)


def _run_virtually(files: Files, options: Options, count: int, console: Console) -> Verdict:
    """No privilege, no lock on the host: only the result folder is ours alone."""
    program = find_program(SIMULATION)
    features = cache_folder() / "features"
    if not options.dry_run:
        make_folder(options.results, "--results")
    plan = _virtual_plan(files, count, console)
    prune_features(features)

    def executor_of(played: Played) -> Executor:
        if options.scheduler:
            return join_cluster(played, options.scheduler, options.jobs)
        if options.slurm:
            return start_on_slurm(played, options.jobs)
        jobs = options.jobs or len(os.sched_getaffinity(0))
        return ProcessExecutor(played, program, features, jobs)

    return _run_plan(plan, files[1], options, executor_of, console)


def plan_virtually(name: str, settings: list[str], console: Console) -> tuple[Plan, YamlSource]:
    """An experiment as virtual runs of this host, one per cell; its datasets are prepared, and
    nothing is executed."""
    library = Library()
    experiment, source = library.experiment(name, settings)
    profiles = check(experiment, source, library, VIRTUAL)
    return _virtual_plan((experiment, source, library, profiles), 1, console), source


def _virtual_plan(files: Files, count: int, console: Console) -> Plan:
    provide = _provider(files[2], console)
    software = host_software(program=SIMULATION)
    return make_plan(*files, VIRTUAL, software, count, provide, say=partial(_say, console))


def _run_plan(
    plan: Plan,
    source: YamlSource,
    options: Options,
    executor_of: Callable[[Played], Executor],
    console: Console,
) -> Verdict:
    """Executes what is missing of a plan."""
    experiment = plan.experiment
    for line in plan.left_out:
        _say(console, f"left out: {line}")
    for line in notes(experiment, Library()):
        _say(console, line)
    folder = ResultFolder(options.results / experiment.id)
    about = chosen(plan.specs, options.only)
    if options.dry_run:
        jobs = options.jobs or (len(os.sched_getaffinity(0)) if _is_virtual(plan) else 1)
        forced = _forced(plan.specs, options)
        for line in preview(
            about, folder.store, _kept(options), expected_run_s(plan), jobs, forced
        ):
            _say(console, line)
        return Verdict()
    make_folder(folder.path, "--results")
    played = {k: (s.path, s.played_s(experiment.playback)) for k, s in plan.sequences.items()}
    with host_lock(
        f"slambed run {experiment.id}",
        folder.path / ".lock",
        math.inf if options.wait else 0.0,
        f"another campaign writes to {folder.path}",
    ):
        # Before anything is written: an address with a typo must leave no trace.
        executor = executor_of(played)
        try:
            folder.create()
            return _execute(plan, source, options, folder, executor, console)
        finally:
            executor.close()
            folder.close()
            give_to_caller(folder.path)
            for shared in (folder.store.runs, folder.store.attempts):
                if shared.is_dir():
                    give_to_caller(shared)


def _execute(
    plan: Plan,
    source: YamlSource,
    options: Options,
    folder: ResultFolder,
    executor: Executor,
    console: Console,
) -> Verdict:
    experiment, engine = plan.experiment, plan.circumstances.engine
    ledger = Ledger(folder.path / "ledger.jsonl")
    ordered = interleaved(plan.specs, experiment.seed)
    wanted = {spec.run_key for spec in chosen(ordered, options.only)}
    forced = _forced(ordered, options)
    todo = [
        spec
        for spec in ordered
        if spec.run_key in wanted
        and (spec.run_key in forced or folder.state(spec.run_key) not in _kept(options))
    ]
    before = object_or_empty(folder.path / "experiment.json")
    shown = [*ordered, *further_repetitions(folder.store, ordered)]
    content = experiment_json(plan, source, shown, before)
    folder.write_json("experiment.json", content)
    folder.show(run["run_key"] for run in content["runs"])
    ledger.append(
        "campaign_started", runs=len(ordered), todo=[s.run_key for s in todo], command=sys.argv
    )
    for sequence in plan.sequences.values():
        if (truth := sequence.path / "groundtruth.txt").is_file():
            keep_groundtruth(folder.path, sequence.id, truth)
    run_s = expected_run_s(plan)
    _say(
        console,
        f"{experiment.title}: {len(ordered)} runs, {len(wanted) - len(todo)} there already, "
        + (f"{len(ordered) - len(wanted)} not asked for, " if len(wanted) < len(ordered) else "")
        + f"engine {engine}, about {duration(run_s * len(todo) / executor.jobs)}",
    )
    with CampaignProgress(console, len(todo), run_s, executor.jobs) as progress:
        runner = Runner(
            folder, ledger, executor, options.retries, forced, options.keep_going, options.plans
        )
        verdict = runner.run(todo, progress)
    ledger.append("campaign_ended", done=verdict.done, interrupted=verdict.interrupted)
    verdict.folder = folder.path
    return verdict


def _forced(specs: list[RunSpec], options: Options) -> frozenset[str]:
    if not options.force:
        return frozenset()
    return frozenset(spec.run_key for spec in chosen(specs, options.force, "--force"))


def _kept(options: Options) -> tuple[str, ...]:
    """States of runs that are not executed again."""
    return ("trusted",) if options.retries else ("trusted", "untrusted")


def _is_virtual(plan: Plan) -> bool:
    return plan.circumstances.engine == VIRTUAL


def expected_run_s(plan: Plan) -> float:
    """A first guess at how long one run takes."""
    playback = plan.experiment.playback
    longest_s = max(sequence.played_s(playback) for sequence in plan.sequences.values())
    return longest_s * VIRTUAL_SHARE if _is_virtual(plan) else longest_s + OVERHEAD_S


def _say(console: Console, line: str) -> None:
    console.print(line, highlight=False, markup=False, soft_wrap=True)
