# SPDX-License-Identifier: Apache-2.0
"""`slambed doctor`, `images`, `setup` and `clean`: commands about this host."""

import os
import subprocess
from dataclasses import asdict
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from slambed.commands.shared_options import check_engine
from slambed.errors import ExitCode, environment_error
from slambed.files.outputs import make_folder
from slambed.terminal import JsonOption, console, print_json


def doctor(as_json: JsonOption = False) -> None:
    """Show what this machine can do, and what each missing part prevents."""
    from slambed.commands import doctor as examination

    findings = examination.examine()
    if as_json:
        can_run = examination.can_run(findings)
        print_json({"can_run": can_run, "findings": [asdict(item) for item in findings]})
        raise typer.Exit(ExitCode.OK if can_run else ExitCode.ENVIRONMENT)
    marks = {
        "good": Text("ok", "green"),
        "missing": Text("--", "yellow"),
        "fatal": Text("no", "red"),
    }
    table = Table("", "", "found", "without it", box=None)
    for item in findings:
        table.add_row(marks[item.level], item.topic, item.found, item.cost)
    console().print(table)
    if not examination.can_run(findings):
        raise typer.Exit(ExitCode.ENVIRONMENT)


def images(
    force: Annotated[bool, typer.Option("--force", help="Build even if it is there.")] = False,
) -> None:
    """Build the node image for the sources of this checkout."""
    from slambed.engines.docker_image import build_image, connect, find_image, image_tag

    client = connect()
    there = find_image(client) is not None
    client.close()
    if there and not force:
        typer.echo(f"{image_tag()} is there")
        return
    build_image()


def setup(
    engine: Annotated[
        str, typer.Option(help="auto, docker, local or virtual: what the programs are for.")
    ] = "auto",
) -> None:
    """Compile the C++ programs of this package.

    Where Docker answers they are compiled in the build of the node image and copied from it; else
    on this host, with packages that are installed by apt. In a checkout, 'make build' does the
    same. A wheel that has the programs needs no setup; with engine docker the node image is made of
    them.
    """
    from slambed.native import brings_programs, build_folder, repository_root
    from slambed.spec.software import source_hash

    check_engine(engine)
    place = build_folder()
    if not brings_programs():
        make_folder(place, "$SLAMBED_CACHE")
    variables = {"SLAMBED_BUILD": str(place), "SLAMBED_SOURCES": source_hash()}
    command = ["bash", str(repository_root() / "tools" / "build.sh"), engine]
    if subprocess.run(command, check=False, env=os.environ | variables).returncode != 0:
        raise environment_error("the programs could not be built; see the lines above")
    typer.echo(f"programs: {place / 'bin'}")


def clean() -> None:
    """Remove what killed campaigns left on this host (containers, processes, control groups) and on
    the boards they used."""
    from slambed.engines.board.leftovers import clean_boards
    from slambed.engines.host_lock import STOP, host_lock
    from slambed.engines.reaper import reap

    with host_lock("slambed clean", advice=STOP):
        typer.echo(f"removed: {reap() or 'nothing'}")
        clean_boards(typer.echo)
