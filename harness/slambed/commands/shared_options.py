# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share because they mean the same in each."""

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from slambed.errors import SlambedError
from slambed.failures import INTERRUPTED
from slambed.terminal import RESULTS

ENGINES = ("auto", "docker", "local", "virtual")

EngineOption = Annotated[
    str | None,
    typer.Option("--engine", help="docker, local, virtual or auto; instead of the experiment's."),
]
JobsOption = Annotated[
    int | None,
    typer.Option(
        "--jobs",
        min=1,
        help="Virtual runs at a time; all CPUs if not given.",
    ),
]
ClusterJobsOption = Annotated[
    int | None,
    typer.Option(
        "--jobs",
        min=1,
        help="Virtual runs at a time; if not given, all CPUs, or all threads of --scheduler's "
        "workers. --slurm needs it.",
    ),
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler", help="Make virtual runs on the workers of this Dask scheduler: tcp://..."
    ),
]
SlurmOption = Annotated[
    bool, typer.Option("--slurm", help="Make virtual runs in --jobs Slurm jobs.")
]
PictureOption = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        help=".png, .svg or .pdf to write; default: in the cache, its path is printed.",
    ),
]
SheetOption = Annotated[
    Path | None,
    typer.Option(
        "-o", "--output", help=".png to write; default: in the cache, its path is printed."
    ),
]


def check_engine(engine: str | None) -> None:
    """Raises SlambedError for an unknown engine."""
    if engine is not None and engine not in ENGINES:
        raise SlambedError(f"unknown engine '{engine}'; known: {', '.join(ENGINES)}")


def check_cluster(scheduler: str | None, slurm: bool) -> None:
    """Raises SlambedError where virtual runs are to go to two clusters."""
    if scheduler and slurm:
        raise SlambedError("give one of --scheduler ADDRESS, --slurm")


def status_command(experiment: str, results: Path) -> str:
    """Returns the command that says why runs in this results folder are invalid."""
    place = [] if results == RESULTS else ["--results", str(results)]
    return shlex.join(["slambed", "status", experiment, *place])


def interrupted(left: str = "") -> typer.Exit:
    """Shows how to continue after Ctrl-C; returns the exit to raise. `left`: words about what is
    left."""
    again = shlex.join(["slambed", *sys.argv[1:]])
    kept = ", ".join(["finished runs are kept", *([left] if left else [])])
    typer.echo(f"interrupted; {kept}{';' if left else ','} go on with: {again}", err=True)
    return typer.Exit(INTERRUPTED)
