# SPDX-License-Identifier: Apache-2.0
"""`slambed check-system` and `slambed new`: the user's own systems, datasets and experiments."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from slambed.errors import ExitCode
from slambed.terminal import console


def check_system(
    system: Annotated[str, typer.Argument(help="Name of a system, or path of its system.yaml.")],
) -> None:
    """Play twenty frames of each sensor to your own system, and show what of the contract holds."""
    from slambed.campaign.check_system import check_system as checked
    from slambed.spec import library

    found = checked(system, library.Library(), partial(typer.echo, err=True))
    for good, line in found.lines:
        mark = Text("ok " if good else "no ", "green" if good else "red")
        console().print(mark, line, soft_wrap=True, highlight=False)
    for role, printed in found.printed.items():
        typer.echo(f"\nlast lines that the {role} program printed:\n{printed}")
    if not found.good:
        raise typer.Exit(ExitCode.NOT_ALL_GOOD)


def new(
    kind: Annotated[str, typer.Argument(help="system, dataset or experiment.")],
    name: Annotated[str, typer.Argument(help="Name of the new folder or file.")],
    folder: Annotated[Path, typer.Option(help="Where to write it.")] = Path(),
    reads_folder: Annotated[
        bool,
        typer.Option(
            "--reads-folder",
            help="System: a program that reads a folder of pictures and writes a trajectory.",
        ),
    ] = False,
) -> None:
    """Write a working skeleton of a system, a dataset or an experiment for you to change."""
    from slambed.campaign.skeletons import write_skeleton

    for line in write_skeleton(kind, name, folder, reads_folder):
        typer.echo(line)
