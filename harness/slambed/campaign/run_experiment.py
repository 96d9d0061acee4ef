# SPDX-License-Identifier: Apache-2.0
"""`slambed run`: executes the missing runs of an experiment."""

import math
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from rich.console import Console

from slambed.campaign.cluster import join_cluster, start_on_slurm
from slambed.campaign.datasets import must_be_made
from slambed.campaign.executors import Executor, Played
from slambed.campaign.options import Options
from slambed.campaign.plan import (
    Files,
    Plan,
    check,
    make_plan,
    repetitions,
)
from slambed.campaign.prepared_inputs import Notify, prepare_input
from slambed.campaign.processes import ProcessExecutor
from slambed.campaign.run_plan import (
    check_selections,
    datasets_to_play,
    is_idle,
    print_to,
    run_plan,
)
from slambed.campaign.runner import CampaignOutcome, stop_on_signal
from slambed.campaign.store import RunStore
from slambed.data.places import cache_folder
from slambed.engines.host_lock import host_lock
from slambed.engines.virtual import prune_features
from slambed.errors import SlambedError, environment_error
from slambed.files.outputs import make_folder
from slambed.files.yaml_source import YamlSource
from slambed.native import SIMULATION, find_program
from slambed.process.cpus import own_cpus
from slambed.spec.chosen_device import has_boards
from slambed.spec.device import VIRTUAL
from slambed.spec.experiment import Experiment
from slambed.spec.hosts import Host, read_hosts
from slambed.spec.library import Library
from slambed.spec.software import host_software


def run_experiment(
    name: str,
    options: Options,
    console: Console,
    check_first: Callable[[Experiment, YamlSource], None] = lambda experiment, source: None,
) -> CampaignOutcome:
    """Executes the missing runs of an experiment into `results/<its id>`.

    All errors in the files are found before anything is started. `check_first`: further checks of
    the caller that this package does not know.
    """
    library = Library()
    experiment, source = library.experiment(name, options.settings)
    check_first(experiment, source)
    count = repetitions(experiment, options.runs)
    hosts, asked = hosts_and_engine(experiment, source, options)
    profiles = check(experiment, source, library, asked)
    files = (experiment, source, library, profiles)
    check_selections(files, asked, options)
    notify = partial(print_to, console)
    if hosts:
        return _on_hosts(files, hosts, options, count, console, notify)
    if asked == VIRTUAL:
        return _virtually(files, options, count, console, notify)
    return _on_this_host(files, asked, options, count, console, notify)


def hosts_and_engine(
    experiment: Experiment, source: YamlSource, options: Options
) -> tuple[list[Host], str]:
    """Returns the hosts of --hosts, none without it, and the engine. Raises SlambedError for
    options that do not fit each other or the experiment."""
    hosts = _hosts(options)
    asked = hosts[0].engine if hosts else options.engine or experiment.engine
    if (options.scheduler or options.slurm) and asked != VIRTUAL:
        raise SlambedError(
            "--scheduler and --slurm are for virtual runs, a live run takes a whole host: "
            "add --engine virtual"
        )
    # A paper's experiments may be virtual and live ones.
    if options.jobs is not None and asked != VIRTUAL and options.overall is None:
        raise SlambedError(
            "--jobs is for virtual runs, a live run takes a whole host: add --engine virtual, or "
            "leave it out"
        )
    if options.slurm and options.jobs is None:
        raise SlambedError("--slurm needs --jobs: how many one-core jobs to ask Slurm for")
    if hosts and experiment.roles is not None:
        raise source.complaint("a mobile node on a board has its edge here: no --hosts", ("roles",))
    return hosts, asked


def _provider(library: Library, notify: Notify) -> Callable[[str], Path]:
    return lambda name: prepare_input(name, library, notify).file


def _on_this_host(
    files: Files, asked: str, options: Options, count: int, console: Console, notify: Notify
) -> CampaignOutcome:
    """Runs on this host, with exclusive use of it."""
    # Importing containers and links takes 0.5 s, which virtual runs do not need.
    from slambed.campaign.boards import BoardLinks, bring_sequences, take_board
    from slambed.campaign.choose import choose_engine, decide
    from slambed.campaign.live_executor import LiveExecutor
    from slambed.campaign.live_plan import look_ahead, plan_of, without_making
    from slambed.engines.board.engine import BoardEngine
    from slambed.engines.live_run import LinkOpener
    from slambed.engines.reaper import mark_children, reap
    from slambed.link.helper_link import HelperLinkOpener
    from slambed.link.run_link import open_for_run

    experiment, source, library, _ = files
    decide(asked)
    provide = _provider(library, notify)
    if options.dry_run:
        plan = look_ahead(files, asked, count, provide, console, notify)
        return run_plan(plan, source, options, _not_idle, console)
    make_folder(options.results, "--results")
    there = without_making(files, asked, count) if _may_be_there(experiment, options) else None
    if there is not None and is_idle(there, options):
        return run_plan(there, source, options, _not_idle, console)
    lock = host_lock(
        f"slambed run {experiment.id}",
        wait_s=math.inf if options.wait else 0.0,
        where=options.results / experiment.id,
        notify=notify,
    )
    with lock, mark_children():
        if found := str(reap()):
            notify(f"removed what a killed campaign left: {found}")
        engine, software = choose_engine(asked, console)
        open_link: LinkOpener = HelperLinkOpener(engine) if engine.unprivileged else open_for_run
        board: BoardEngine | None = None
        with ExitStack() as cleanup:
            if experiment.roles is not None:
                board = take_board(engine, experiment.roles.mobile, notify)
                cleanup.callback(board.close)
                open_link = BoardLinks(board)
            known = None if board is None else board.board
            plan = plan_of(files, engine, software, count, provide, notify, known)

            def executor_of(played: Played) -> Executor:
                _await_quiet(60.0 * options.quiet_within_min, notify)
                if board is not None:
                    needed = datasets_to_play(plan, options)
                    bring_sequences(board, {k: v for k, v in played.items() if k in needed})
                return LiveExecutor(board or engine, open_link, played)

            return run_plan(plan, source, options, executor_of, console)


def _await_quiet(limit_s: float, notify: Notify) -> None:
    """Waits until this host is quiet. A signal meanwhile raises KeyboardInterrupt, so that the
    campaign does not start."""
    from slambed.campaign.quiet import wait_for_quiet

    with stop_on_signal() as stop:
        load = wait_for_quiet(limit_s, stop, notify)
    if stop.is_set():
        raise KeyboardInterrupt
    notify(str(load))


def _not_idle(played: Played) -> Executor:
    """Replaces the executor when a check found nothing to execute."""
    raise environment_error("runs that were there have gone meanwhile; call the same command again")


def _hosts(options: Options) -> list[Host]:
    """Returns the hosts of the live runs; empty without --hosts."""
    if options.hosts is None:
        if options.on:
            raise SlambedError("--on chooses hosts of a file: give it with --hosts FILE")
        return []
    if options.scheduler or options.slurm or options.engine == VIRTUAL:
        raise SlambedError(
            "--hosts is for live runs; virtual ones go to many machines with --scheduler or --slurm"
        )
    return read_hosts(options.hosts, options.on, options.engine)


def _on_hosts(
    files: Files,
    hosts: list[Host],
    options: Options,
    count: int,
    console: Console,
    notify: Notify,
) -> CampaignOutcome:
    """Runs on the hosts of a file, with exclusive use of each one."""
    from slambed.campaign.hosts import JoinedHosts

    experiment, source, library, _ = files

    def plan_of(joined: JoinedHosts) -> Plan:
        return make_plan(
            *files,
            joined.engine,
            joined.software,
            count,
            _provider(library, notify),
            foreign=joined.foreign(experiment),
            notify=notify,
            netem=joined.netem,
        )

    if not options.dry_run:
        make_folder(options.results, "--results")
    if options.dry_run or _may_be_there(experiment, options):
        about_hosts = notify if options.dry_run else lambda line: None
        with JoinedHosts(hosts, about_hosts, take=False) as joined:
            plan = plan_of(joined)
        if options.dry_run or is_idle(plan, options):
            return run_plan(plan, source, options, _not_idle, console, len(hosts))
    boards = has_boards(experiment, source, library)
    quiet_s = 60.0 * options.quiet_within_min
    with JoinedHosts(hosts, notify, options.wait, quiet_s, boards) as joined:
        plan = plan_of(joined)

        def executor_of(played: Played) -> Executor:
            return joined.executor(played, experiment.seed)

        return run_plan(plan, source, options, executor_of, console, len(hosts))


def _may_be_there(experiment: Experiment, options: Options) -> bool:
    """Returns whether to check for pending runs before a host is taken."""
    return bool(RunStore(options.results).keys()) and not any(
        must_be_made(name) for name in experiment.datasets
    )


def _virtually(
    files: Files, options: Options, count: int, console: Console, notify: Notify
) -> CampaignOutcome:
    """Runs virtually: needs no privilege and locks only the result folder."""
    program = find_program(SIMULATION)
    features = cache_folder() / "features"
    if not options.dry_run:
        make_folder(options.results, "--results")
    plan = _virtual_plan(files, count, notify, options.datasets)
    if not options.dry_run:
        prune_features(features)

    def executor_of(played: Played) -> Executor:
        if options.scheduler:
            return join_cluster(played, options.scheduler, options.jobs, notify)
        if options.slurm and options.jobs is not None:
            return start_on_slurm(played, options.jobs, notify)
        jobs = options.jobs or len(own_cpus())
        return ProcessExecutor(played, program, features, jobs)

    return run_plan(plan, files[1], options, executor_of, console)


def plan_virtually(name: str, settings: list[str], console: Console) -> tuple[Plan, YamlSource]:
    """Returns the plan of an experiment as virtual runs on this host, one per cell. Prepares its
    datasets and executes nothing."""
    library = Library()
    experiment, source = library.experiment(name, settings)
    profiles = check(experiment, source, library, VIRTUAL)
    notify = partial(print_to, console)
    return _virtual_plan((experiment, source, library, profiles), 1, notify), source


def _virtual_plan(
    files: Files, count: int, notify: Notify, datasets: frozenset[str] | None = None
) -> Plan:
    provide = _provider(files[2], notify)
    software = host_software(program=SIMULATION)
    return make_plan(*files, VIRTUAL, software, count, provide, notify=notify, only_on=datasets)
