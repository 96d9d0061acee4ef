# SPDX-License-Identifier: Apache-2.0
"""Executes the missing runs of a plan with any executor, or previews them."""

import math
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial

from rich.console import Console

from slambed.caller import give_to_caller, will_be_callers
from slambed.campaign.campaign_state import being_run
from slambed.campaign.executors import Executor, NoRuns, Played
from slambed.campaign.folder import ResultFolder
from slambed.campaign.host_executor import HostExecutor
from slambed.campaign.ledger import Ledger
from slambed.campaign.options import Options
from slambed.campaign.order import in_part, interleaved
from slambed.campaign.plan import Files, Plan, experiment_json, first_runs, notes
from slambed.campaign.progress import CampaignProgress, duration
from slambed.campaign.run_estimate import expected_run_s
from slambed.campaign.runner import CampaignOutcome, Runner
from slambed.campaign.runs_beyond_plan import valid_repetitions
from slambed.campaign.store import RunStore
from slambed.engines.host_lock import host_lock
from slambed.files.json_file import object_or_empty
from slambed.files.outputs import make_folder
from slambed.files.yaml_source import YamlSource
from slambed.metrics.collect import keep_groundtruth
from slambed.process.cpus import own_cpus
from slambed.process.hangup import interrupted_by_sigterm
from slambed.spec.device import VIRTUAL
from slambed.spec.library import Library
from slambed.spec.run_spec import RunSpec
from slambed.spec.selection import Selection, facts_of, meant


def run_plan(
    plan: Plan,
    source: YamlSource,
    options: Options,
    executor_of: Callable[[Played], Executor],
    console: Console,
    hosts: int = 1,
) -> CampaignOutcome:
    """Executes the missing runs of a plan. `hosts`: number of hosts that execute live runs."""
    experiment = plan.experiment
    for line in plan.left_out:
        print_to(console, f"left out: {line}")
    for line in notes(experiment, Library()) + plan.remarks:
        print_to(console, line)
    folder = ResultFolder(options.results / experiment.id)
    asked = chosen(plan.specs, options.only)
    if options.dry_run:
        for line in being_run(options.results, experiment.id):
            print_to(console, line)
        jobs = (options.jobs or len(own_cpus())) if _is_virtual(plan) else hosts
        forced = _forced(plan.specs, options)
        kept, run_s, virtual = _kept(options), expected_run_s(plan), _is_virtual(plan)
        for line in preview(asked, folder.store, kept, run_s, jobs, forced, virtual):
            print_to(console, line)
        return CampaignOutcome()
    make_folder(folder.path, "--results")
    will_be_callers(options.results)
    notify = partial(print_to, console)
    played = {k: (s.path, s.played_s(experiment.playback)) for k, s in plan.sequences.items()}
    lock = host_lock(
        f"slambed run {experiment.id}",
        folder.path / ".lock",
        math.inf if options.wait else 0.0,
        f"another campaign writes to {folder.path}",
        where=folder.path,
        notify=notify,
    )
    with lock, interrupted_by_sigterm():
        # Before anything is written: a mistyped scheduler address must leave no files.
        try:
            executor = NoRuns() if is_idle(plan, options) else executor_of(played)
        except KeyboardInterrupt:
            # It waited for the first job of a cluster, or for this host to become quiet; both may
            # take hours.
            return CampaignOutcome(interrupted=True)
        try:
            folder.create()
            return _fill(plan, source, options, folder, executor, console)
        finally:
            executor.close()
            folder.close()
            give_to_caller(folder.path)
            for shared in (folder.store.runs, folder.store.attempts):
                if shared.is_dir():
                    give_to_caller(shared)


def preview(
    specs: list[RunSpec],
    store: RunStore,
    again: tuple[str, ...],
    run_s: float,
    jobs: int,
    forced: frozenset[str] = frozenset(),
    virtual: bool = False,
) -> list[str]:
    """Returns one line per cell with its existing runs, and one with the expected time for the
    rest."""
    lines, todo = [], 0
    for cell in dict.fromkeys(spec.cell for spec in specs):
        own = [spec for spec in specs if spec.cell == cell]
        keys = [spec.run_key for spec in own if spec.run_key not in forced]
        there = sum(store.state(key) in again for key in keys)
        todo += len(own) - there
        lines.append(f"{cell}: {there} of {len(own)} runs there")
    return [*lines, f"{todo} runs to execute, {_about(run_s * todo / jobs, virtual)}"]


def _about(seconds: float, virtual: bool) -> str:
    """Returns an expected duration, made before any run was timed. Other work on the machine
    delays virtual runs; live ones take the time of their sequences."""
    idle = " on an idle machine" if virtual and seconds else ""
    return f"about {duration(seconds)}{idle}"


def _fill(
    plan: Plan,
    source: YamlSource,
    options: Options,
    folder: ResultFolder,
    executor: Executor,
    console: Console,
) -> CampaignOutcome:
    experiment, engine = plan.experiment, plan.circumstances.engine
    ledger = Ledger(folder.path / "ledger.jsonl")
    ordered = interleaved(plan.specs, experiment.seed)
    wanted = _wanted(ordered, options)
    forced = _forced(ordered, options)
    todo = _todo(ordered, folder, options)
    before = object_or_empty(folder.path / "experiment.json")
    shown = [*ordered, *valid_repetitions(folder.store, ordered)]
    content = experiment_json(plan, source, shown, before)
    folder.write_json("experiment.json", content)
    folder.show(run["run_key"] for run in content["runs"])
    runner = Runner(
        folder, ledger, executor, options.retries, forced, options.keep_going, options.plans
    )
    ledger.append(
        "campaign_started",
        runs=len(ordered),
        there=len(wanted) - len(todo),
        todo=[s.run_key for s in todo],
        command=sys.argv,
    )
    try:
        for sequence in plan.sequences.values():
            if (truth := sequence.path / "groundtruth.txt").is_file():
                keep_groundtruth(folder.path, sequence.id, truth)
        run_s = expected_run_s(plan)
        wait_s = run_s * len(todo) / executor.jobs
        not_asked = len(ordered) - len(wanted)
        print_to(
            console,
            f"{experiment.title}: {len(ordered)} runs, {len(wanted) - len(todo)} there already, "
            + (f"{not_asked} not asked for, " if not_asked else "")
            + f"engine {engine}, {_links(plan)}{_about(wait_s, engine == VIRTUAL)}",
        )
        overall = options.overall
        if overall is not None:
            overall.begin(experiment.id, len(wanted) - len(todo), len(todo), executor.jobs)
        with CampaignProgress(console, len(todo), run_s, executor.jobs, overall) as progress:
            runner.there = len(wanted) - len(todo)
            if not (options.hosts or options.scheduler or options.slurm):  # those have their own
                runner.sequences = {id: sequence.path for id, sequence in plan.sequences.items()}
            if overall is not None:
                runner.may_start = lambda: not overall.is_used_up
            if isinstance(executor, HostExecutor):
                runner.places = executor
            verdict = runner.run(todo, progress)
    finally:
        # Also of a campaign that failed, or who watches it waits for the end of this process. A
        # full disk has no room for the line.
        with suppress(OSError):
            so_far = runner.verdict
            ledger.append("campaign_ended", done=so_far.done, interrupted=so_far.interrupted)
    verdict.folder = folder.path
    return verdict


def _links(plan: Plan) -> str:
    """Returns what shapes the live links, such as `links by netem and relay, `; empty where models
    do, or without a link."""
    live = sorted({*plan.circumstances.link_backends.values()} & {"netem", "relay"})
    return f"links by {' and '.join(live)}, " if live else ""


def _todo(specs: list[RunSpec], folder: ResultFolder, options: Options) -> list[RunSpec]:
    """Returns the runs to execute, in order."""
    wanted = _wanted(specs, options)
    forced, kept = _forced(specs, options), _kept(options)
    return [
        spec
        for spec in specs
        if spec.run_key in wanted
        and (spec.run_key in forced or folder.state(spec.run_key) not in kept)
    ]


def chosen(specs: list[RunSpec], only: Iterable[str], option: str = "--only") -> list[RunSpec]:
    """Returns the runs that match the selections (slambed.spec.selection); all without
    selections. Raises SlambedError for a selection without a match."""
    runs = [
        facts_of(
            s.cell,
            s.system,
            s.variant,
            [s.label],
            s.dataset,
            s.profile,
            s.device_mobile.name,
            s.device_edge.name if s.device_edge is not None else None,
            s.engine,
            s.pace,
            s.params,
        )
        for s in specs
    ]
    return [s for s, ours in zip(specs, meant([*runs], only, option), strict=True) if ours]


def check_selections(files: Files, engine: str, options: Options) -> None:
    """Raises SlambedError for a selection that no run can match, before datasets are prepared.
    What depends on the host is checked later: the engine that is chosen, and a board's device."""
    if files[0].roles is not None or not (options.only or options.force):
        return
    cells = first_runs(*files, engine)
    for option, texts in (("--only", options.only), ("--force", options.force)):
        chosen(cells, [text for text in texts if "engine" not in Selection.of(text).keys], option)


def _wanted(specs: list[RunSpec], options: Options) -> set[str]:
    """Returns the keys of the runs that were asked for on this machine."""
    keys = (spec.run_key for spec in chosen(specs, options.only))
    return {
        key
        for key in keys
        if in_part(key, options.part) and (options.keys is None or key in options.keys)
    }


def is_idle(plan: Plan, options: Options) -> bool:
    """Returns whether no run is pending, so that only the report is left to do."""
    return not _todo(plan.specs, ResultFolder(options.results / plan.experiment.id), options)


def datasets_to_play(plan: Plan, options: Options) -> set[str]:
    """Returns the sequences of the pending runs."""
    folder = ResultFolder(options.results / plan.experiment.id)
    return {spec.dataset for spec in _todo(plan.specs, folder, options)}


def _forced(specs: list[RunSpec], options: Options) -> frozenset[str]:
    if not options.force:
        return frozenset()
    return frozenset(spec.run_key for spec in chosen(specs, options.force, "--force"))


def _kept(options: Options) -> tuple[str, ...]:
    """States of runs that are not executed again."""
    return ("valid",) if options.retries else ("valid", "invalid")


def _is_virtual(plan: Plan) -> bool:
    return plan.circumstances.engine == VIRTUAL


def print_to(console: Console, line: str) -> None:
    """Prints a line without markup."""
    console.print(line, highlight=False, markup=False, soft_wrap=True)
