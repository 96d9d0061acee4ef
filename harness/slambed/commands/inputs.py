# SPDX-License-Identifier: Apache-2.0
"""`slambed inputs`: files that runs need and that other runs produce."""

import json
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from slambed.terminal import JsonOption, console, json_entry, lists_alone, print_json

if TYPE_CHECKING:
    from slambed.campaign.prepared_inputs import PreparedInput
    from slambed.spec.library import Library

app = typer.Typer(help="Prior maps and reference paths, made by runs.")
Name = Annotated[str, typer.Argument(help="Name of a recipe in catalog/inputs/.")]


def list_inputs(as_json: JsonOption = False) -> None:
    """List every recipe, and when its newest file was made."""
    from slambed.campaign.prepared_inputs import find_prepared, inputs_folder
    from slambed.spec.library import Library

    library = Library()
    if as_json:
        print_json([_entry(library, name) for name in library.inputs()])
        return
    table = Table("input", "yields", "of", "made", "title", box=None)
    for name in library.inputs():
        recipe, _ = library.input(name)
        made = find_prepared(name)
        state = str(made[0].record.get("made_utc", ""))[:16] if made else "-"
        table.add_row(name, recipe.yields, recipe.dataset, state, recipe.title)
    console().print(table)
    typer.echo("its run, and what was found of it: 'slambed inputs show NAME'")
    typer.echo(f"kept in {inputs_folder()}")


@app.command()
def prepare(name: Name) -> None:
    """Make the file of a recipe now, or find an existing one; experiments do this themselves."""
    from slambed.campaign.prepared_inputs import prepare_input
    from slambed.spec.library import Library

    made = prepare_input(name, Library(), typer.echo)
    typer.echo(f"{made.file}\nSHA-256 {made.sha256}")


@app.command()
def show(name: Name, as_json: JsonOption = False) -> None:
    """Show the newest file of a recipe: the run that made it, and what was measured of it."""
    from slambed.campaign.prepared_inputs import find_prepared
    from slambed.spec.library import Library

    library = Library()
    library.input(name)
    if as_json:
        print_json(_entry(library, name))
        return
    made = find_prepared(name)
    if not made:
        typer.echo(f"{name} was not made yet: slambed inputs prepare {name}")
        return
    typer.echo(json.dumps(_record(made[0]), indent=1))


def _entry(library: "Library", name: str) -> dict[str, Any]:
    """Returns a recipe with its newest file, or null where none was made."""
    from slambed.campaign.prepared_inputs import find_prepared

    made = find_prepared(name)
    recipe = json_entry(name, lambda name: library.input(name)[0])
    return {**recipe, "made": _record(made[0]) if made else None}


def _record(made: "PreparedInput") -> dict[str, Any]:
    return {"path": str(made.file)} | made.record


lists_alone(app, list_inputs)
