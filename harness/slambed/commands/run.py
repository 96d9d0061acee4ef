# SPDX-License-Identifier: Apache-2.0
"""`slambed run`."""

from pathlib import Path
from typing import Annotated

import typer

from slambed.commands.shared_options import (
    ClusterJobsOption,
    EngineOption,
    SchedulerOption,
    SlurmOption,
    check_cluster,
    check_engine,
    interrupted,
)
from slambed.errors import SlambedError
from slambed.spec.experiment_name import must_be_an_experiment
from slambed.spec.selection import SYNTAX
from slambed.terminal import RESULTS, ResultsOption, console


def run(
    context: typer.Context,
    experiment: Annotated[
        str | None,
        typer.Argument(
            help="Name in experiments/, or path of a YAML file; without one, they are listed."
        ),
    ] = None,
    runs: Annotated[
        str | None, typer.Option(help="Runs per combination: a number, 'default' or 'paper'.")
    ] = None,
    engine: EngineOption = None,
    results: ResultsOption = RESULTS,
    check: Annotated[
        bool,
        typer.Option("--check", help="Only check the files, and whether this host has the engine."),
    ] = False,
    wait: Annotated[
        bool, typer.Option("--wait", help="Wait for another campaign on this host to end.")
    ] = False,
    jobs: ClusterJobsOption = None,
    scheduler: SchedulerOption = None,
    slurm: SlurmOption = False,
    hosts: Annotated[
        Path | None,
        typer.Option(help="Make live runs on the hosts of this YAML file, one at a time on each."),
    ] = None,
    on: Annotated[
        list[str] | None,
        typer.Option("--on", help="With --hosts: only this host, or those with this label."),
    ] = None,
    retries: Annotated[int, typer.Option(min=0, help="Further attempts of an invalid run.")] = 2,
    wait_for_quiet: Annotated[
        float,
        typer.Option(min=0, help="Minutes to wait for a quiet host before live runs."),
    ] = 0.0,
    figures: Annotated[bool, typer.Option(help="Draw figures for the report.")] = True,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="KEY=VALUE instead of the file's, or params.NAME=VALUE."),
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option("--only", help=f"Execute these only: {SYNTAX}.")
    ] = None,
    force: Annotated[
        list[str] | None,
        typer.Option(
            "--force", help="Execute these again, also where they are there; as for --only."
        ),
    ] = None,
    keep_going: Annotated[
        bool, typer.Option("--keep-going", help="Go on however many runs have to be given up.")
    ] = False,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run",
            help="Show what would be executed, and how long it takes. Prepares missing sequences.",
        ),
    ] = False,
) -> None:
    """Execute the missing runs of an experiment, then show and write its report.

    Valid runs are kept: after an interrupt, the same command continues.
    """
    from slambed.campaign import plan
    from slambed.campaign.check_engine import engine_here
    from slambed.campaign.options import Options
    from slambed.campaign.run_experiment import hosts_and_engine
    from slambed.commands.report_request import check_figure_names
    from slambed.commands.run_and_report import raise_unless_good, run_and_report
    from slambed.spec.library import Library

    if experiment is None:
        _list_experiments(context)
        return
    must_be_an_experiment(experiment, Library().experiments())
    check_engine(engine)
    check_cluster(scheduler, slurm)
    options = Options(
        runs,
        engine,
        results,
        wait,
        jobs,
        scheduler,
        slurm,
        hosts,
        on or [],
        retries,
        wait_for_quiet,
        settings or [],
        only or [],
        force or [],
        keep_going,
        dry_run,
    )
    if check:
        library = Library()
        if only or force:
            raise SlambedError(
                "--check does not take --only or --force; --dry-run shows which runs they select"
            )
        found, source = library.experiment(experiment, settings)
        plan.repetitions(found, runs)
        check_figure_names(found, source)
        others, asked = hosts_and_engine(found, source, options)
        profiles = plan.check(found, source, library, asked)
        typer.echo(f"{source.path}: good")
        remarks = plan.unplayed(found, profiles) + plan.remarks_on(profiles)
        for line in plan.notes(found, library) + remarks:
            typer.echo(f"note: {line}")
        if others:
            typer.echo(f"engine: {asked}; not checked here, because the hosts of --hosts play")
            return
        for line in engine_here(asked, found, library):
            typer.echo(line)
        return
    screen = console()
    verdict = run_and_report(experiment, options, screen, figures)
    if verdict.interrupted:
        raise interrupted()
    raise_unless_good([verdict], experiment, results)


def _list_experiments(context: typer.Context) -> None:
    """Shows what `run` could run. An option without an experiment is a mistake."""
    from slambed.commands.listings import list_experiments

    given = [key for key in context.params if _on_the_command_line(context, key)]
    if given:
        raise SlambedError("which experiment? 'slambed run' without options lists them")
    list_experiments()


def _on_the_command_line(context: typer.Context, key: str) -> bool:
    source = context.get_parameter_source(key)
    return source is not None and source.name == "COMMANDLINE"
