# SPDX-License-Identifier: Apache-2.0
"""`slambed inputs`: files that runs need and other runs make."""

import json
from typing import Annotated

import typer
from rich.table import Table

from slambed.campaign.prepared_inputs import find_prepared, inputs_folder, prepare_input
from slambed.spec.library import Library
from slambed.terminal import console

app = typer.Typer(help="Prior maps and reference paths, made by runs.", no_args_is_help=True)
Name = Annotated[str, typer.Argument(help="Name of a recipe in inputs/.")]


@app.command("list")
def list_inputs() -> None:
    """Every recipe, and whether a file was made of it."""
    library = Library()
    table = Table("input", "yields", "of", "made", "title", box=None)
    for name in library.inputs():
        recipe, _ = library.input(name)
        made = find_prepared(name)
        state = str(made[0].record.get("made_utc", ""))[:16] if made else "-"
        table.add_row(name, recipe.yields, recipe.dataset, state, recipe.title)
    console().print(table)
    typer.echo(f"kept in {inputs_folder()}")


@app.command()
def prepare(name: Name) -> None:
    """Make a file now, or find it where it was made; experiments do it themselves."""
    made = prepare_input(name, Library(), typer.echo)
    typer.echo(f"{made.file}\nSHA-256 {made.sha256}")


@app.command()
def show(name: Name) -> None:
    """What is known of the newest file of a recipe: its run, and what was found of it."""
    Library().input(name)
    made = find_prepared(name)
    if not made:
        typer.echo(f"{name} was not made yet: slambed inputs prepare {name}")
        return
    typer.echo(json.dumps({"path": str(made[0].file)} | made[0].record, indent=1))
