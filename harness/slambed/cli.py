# SPDX-License-Identifier: Apache-2.0
"""The `slambed` command. Errors are one line; exit codes are in docs/formats.md."""

import os
import select
import sys
from functools import cache
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from slambed import __version__
from slambed.caller import give_caches_to_caller
from slambed.errors import ExitCode, SlambedError
from slambed.failures import INTERRUPTED, line_and_code
from slambed.terminal import console

YAML = (".yaml", ".yml")


app = typer.Typer(
    name="slambed",
    help="A reproducible testbed for edge-offloaded visual SLAM.",
    add_completion=False,
    pretty_exceptions_enable=False,
)
ResultsOption = Annotated[Path, typer.Option("--results", help="Folder of all results.")]


@app.callback(invoke_without_command=True)
def common(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    """A reproducible testbed for edge-offloaded visual SLAM."""
    if version:
        typer.echo(f"slambed {__version__}")
    elif context.invoked_subcommand is None:
        typer.echo(context.get_help())


@app.command()
def run(
    experiment: Annotated[
        str, typer.Argument(help="Name in experiments/, or path of a YAML file.")
    ],
    runs: Annotated[
        str | None, typer.Option(help="Runs per cell: a number, 'default' or 'paper'.")
    ] = None,
    engine: Annotated[
        str | None,
        typer.Option(help="docker, local, virtual or auto; instead of the experiment's."),
    ] = None,
    results: ResultsOption = Path("results"),
    check: Annotated[bool, typer.Option("--check", help="Only check the files.")] = False,
    wait: Annotated[
        bool, typer.Option("--wait", help="Wait for another campaign on this host to end.")
    ] = False,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Virtual runs at a time; all CPUs if not given.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Make virtual runs on the workers of this Dask scheduler: tcp://..."),
    ] = None,
    slurm: Annotated[
        bool, typer.Option("--slurm", help="Make virtual runs in --jobs Slurm jobs.")
    ] = False,
    retries: Annotated[
        int, typer.Option(min=0, help="Further attempts of a run that is not to be trusted.")
    ] = 2,
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
        list[str] | None, typer.Option("--only", help="Execute this cell only; * is any text.")
    ] = None,
    force: Annotated[
        list[str] | None,
        typer.Option(
            "--force", help="Execute this cell again, also where it is there; * is any text."
        ),
    ] = None,
    keep_going: Annotated[
        bool, typer.Option("--keep-going", help="Go on however many runs have to be given up.")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would be executed, and how long it takes.")
    ] = False,
) -> None:
    """Run what is missing of an experiment, then show and write its report.

    Runs that are there and to be trusted are kept: call it again after an interrupt and it goes on.
    """
    from slambed.campaign import plan
    from slambed.campaign.run import Options
    from slambed.report.asked import check_asked
    from slambed.report.run import raise_unless_good, run_and_report
    from slambed.spec.library import Library

    _must_be_an_experiment(experiment, Library().experiments())
    if engine not in (None, "auto", "docker", "local", "virtual"):
        raise SlambedError(f"unknown engine '{engine}'; known: auto, docker, local, virtual")
    if check:
        library = Library()
        if only or force:
            raise SlambedError("--check looks at the files alone; --dry-run looks at cells, too")
        found, source = library.experiment(experiment, settings)
        plan.repetitions(found, runs)
        check_asked(found, source)
        plan.check(found, source, library, engine or found.engine)
        typer.echo(f"{source.path}: good")
        for line in plan.notes(found, library):
            typer.echo(f"note: {line}")
        return
    screen = console()
    if scheduler and slurm:
        raise SlambedError("give one of --scheduler ADDRESS, --slurm")
    options = Options(runs, engine, results, wait, jobs, scheduler, slurm, retries, wait_for_quiet,
                      settings or [], only or [], force or [], keep_going, dry_run)  # fmt: skip
    verdict = run_and_report(experiment, options, screen, figures)
    if verdict.interrupted:
        again = " ".join(["slambed", *sys.argv[1:]])
        typer.echo(f"interrupted; finished runs are kept, go on with: {again}", err=True)
        raise typer.Exit(INTERRUPTED)
    raise_unless_good([verdict], experiment)


def _must_be_an_experiment(given: str, known: list[str]) -> None:
    """A name or a YAML file; what is neither, but is there, is told for what it is."""
    path = Path(given)
    if given in known or path.suffix in YAML:
        return
    what = "an experiment is a name in experiments/ or a file that ends in .yaml or .yml"
    if path.is_dir():
        raise SlambedError(f"{given} is a folder; {what}")
    if path.is_file() or path.suffix.lower() in YAML:
        raise SlambedError(f"{given} does not end in .yaml or .yml; {what}")


@app.command()
def status(
    experiment: Annotated[
        str, typer.Argument(help="Name in experiments/, or of an experiment that was run.")
    ],
    results: ResultsOption = Path("results"),
) -> None:
    """Say which runs are there, which are missing, and why."""
    from slambed.campaign.status import not_run_yet, status_of, was_run
    from slambed.native import repository_root
    from slambed.spec.library import Library
    from slambed.spec.software import host_software, image_software

    name = Path(experiment).stem
    if not was_run(results, name):
        _must_be_an_experiment(experiment, Library().experiments())
        typer.echo(not_run_yet(experiment))
        return
    software = {image_software()}
    for program in ("slambed-node", "slambed-sim"):
        try:
            software.add(host_software(program=program))
        except SlambedError as error:
            typer.echo(f"note: {error}")
    yaml_path = repository_root() / "experiments" / f"{name}.yaml"
    found = status_of(results, name, yaml_path, software)
    table = Table("cell", "trusted", "untrusted", "missing", box=None)
    for cell in found.cells:
        table.add_row(cell.cell, str(cell.trusted), str(len(cell.untrusted)), str(cell.missing))
    screen = console()
    screen.print(table)
    for line in [
        *(f"not to be trusted: {line}" for cell in found.cells for line in cell.untrusted),
        *(f"note: {line}" for line in found.notes),
    ]:
        screen.print(line, highlight=False, markup=False, soft_wrap=True)
    if not found.complete:
        raise typer.Exit(ExitCode.NOT_ALL_GOOD)


@cache
def _add_reports() -> None:
    from slambed.report.cli import add_commands

    add_commands(app)


@cache
def _add_calibrate() -> None:
    from slambed.calibrate.cli import calibrate

    app.command()(calibrate)


@cache
def _add_explain() -> None:
    from slambed.explain.cli import explain

    app.command()(explain)


@cache
def _add_infer() -> None:
    from slambed.infer.cli import infer

    app.command()(infer)


@cache
def _add_host() -> None:
    from slambed.host_cli import clean, doctor, images

    for command in (doctor, images, clean):
        app.command()(command)


@cache
def _add_own() -> None:
    from slambed.campaign.own_cli import check_system, new

    app.command("check-system")(check_system)
    app.command()(new)


@cache
def _add_data() -> None:
    from slambed.data.cli import app as data_app

    app.add_typer(data_app, name="data")


@cache
def _add_masks() -> None:
    from slambed.segment.cli import app as masks_app

    app.add_typer(masks_app, name="masks")


@cache
def _add_inputs() -> None:
    from slambed.campaign.inputs_cli import app as inputs_app

    app.add_typer(inputs_app, name="inputs")


@cache
def _add_results() -> None:
    from slambed.campaign.pack import add_to
    from slambed.campaign.size import app as results_app

    add_to(results_app)
    app.add_typer(results_app, name="results")


@cache
def _add_specs() -> None:
    from slambed.spec.cli import devices, experiments, systems

    app.add_typer(systems, name="systems")
    app.add_typer(devices, name="devices")
    app.add_typer(experiments, name="experiments")


@cache
def _add_links() -> None:
    from slambed.link.cli import app as profile_app
    from slambed.link.cli import link_app

    app.add_typer(profile_app, name="profile")
    app.add_typer(link_app, name="link")


@cache
def _add_papers() -> None:
    from slambed.report.papers_cli import app as papers_app

    app.add_typer(papers_app, name="papers")


HERE = ("run", "status", "--version")
ELSEWHERE = {
    **dict.fromkeys(
        (
            "report",
            "losses",
            "plots",
            "compare",
            "truth",
            "diff",
            "paper",
            "gate",
            "bisect",
            "view",
            "evaluate",
        ),
        _add_reports,
    ),
    **dict.fromkeys(("check-system", "new"), _add_own),
    **dict.fromkeys(("doctor", "images", "clean"), _add_host),
    "calibrate": _add_calibrate,
    "explain": _add_explain,
    "infer": _add_infer,
    "data": _add_data,
    "inputs": _add_inputs,
    "masks": _add_masks,
    "results": _add_results,
    **dict.fromkeys(("systems", "devices", "experiments"), _add_specs),
    **dict.fromkeys(("profile", "link"), _add_links),
    "papers": _add_papers,
}


def _add_commands(asked: str) -> None:
    """Loads the module of one command: all of them, with what they need, take seconds. Whoever asks
    for help, or for what there is not, gets to see them all."""
    if asked in HERE:
        return
    for add in [ELSEWHERE[asked]] if asked in ELSEWHERE else ELSEWHERE.values():
        add()


def main() -> None:
    """Entry point: every failure becomes one line and a documented exit code."""
    sys.exit(run_command(sys.argv[1:]))


def run_command(arguments: list[str]) -> int:
    """The exit code of a command line."""
    try:
        _add_commands(arguments[0] if arguments else "")
        result = app(args=arguments, prog_name="slambed", standalone_mode=False)
        return result if isinstance(result, int) else ExitCode.OK
    except (Exception, KeyboardInterrupt) as error:
        if isinstance(error, BrokenPipeError) and _reader_has_gone():
            # Of our output (`| head`): not an error. Nothing more can be flushed.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return ExitCode.OK
        line, code = line_and_code(error)
        typer.echo(f"error: {' '.join(line.split())}", err=True)
        return code
    finally:
        if arguments and not set(arguments) <= {"--version", "--help"}:
            give_caches_to_caller()


def _reader_has_gone() -> bool:
    """Any other broken pipe is a fault that must be told."""
    output = select.poll()
    output.register(sys.stdout.fileno(), 0)
    return bool(output.poll(0))
