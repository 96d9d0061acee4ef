# SPDX-License-Identifier: Apache-2.0
"""`slambed doctor`, `images` and `clean`: this host, and what runs leave on it."""

from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from slambed.errors import ExitCode
from slambed.terminal import console


def doctor() -> None:
    """Say what this machine can do, and what each missing thing costs."""
    from slambed import doctor as examination

    findings = examination.examine()
    marks = {
        "good": Text("ok", "green"), "missing": Text("--", "yellow"), "fatal": Text("no", "red")
    }  # fmt: skip
    table = Table("", "", "found", "without it", box=None)
    for item in findings:
        table.add_row(marks[item.level], item.topic, item.found, item.cost)
    console().print(table)
    if not examination.can_run(findings):
        raise typer.Exit(ExitCode.ENVIRONMENT)


def images(
    force: Annotated[bool, typer.Option("--force", help="Build even if it is there.")] = False,
) -> None:
    """Build the node image that belongs to the sources of this checkout."""
    from slambed.engines.docker_image import build_image, connect, find_image, image_tag

    client = connect()
    there = find_image(client) is not None
    client.close()
    if there and not force:
        typer.echo(f"{image_tag()} is there")
        return
    build_image()


def clean() -> None:
    """Remove what killed campaigns left on this host: containers, processes, control groups."""
    from slambed.engines.host_lock import host_lock
    from slambed.engines.reaper import reap

    with host_lock("slambed clean"):
        typer.echo(f"removed: {reap() or 'nothing'}")
