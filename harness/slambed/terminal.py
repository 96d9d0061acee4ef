# SPDX-License-Identifier: Apache-2.0
"""Prints tables for terminals and JSON for scripts."""

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from slambed.errors import SlambedError

if TYPE_CHECKING:
    from pydantic import BaseModel

JsonOption = Annotated[
    bool, typer.Option("--json", help="One JSON document instead, for a script.")
]
ResultsOption = Annotated[Path, typer.Option("--results", help="Folder of all results.")]
RESULTS = Path("results")

WIDTH_WITHOUT_TERMINAL = 160


def console() -> Console:
    """Returns a console that does not fold wide tables in log files and pipes. Markup is off,
    because `RTT [ms]` would be read as a tag."""
    if sys.stdout.isatty() or "COLUMNS" in os.environ:
        return Console(markup=False)
    return Console(width=WIDTH_WITHOUT_TERMINAL, markup=False)


def lists_alone(app: typer.Typer, listing: Callable[[bool], None]) -> None:
    """Adds the `list` command, which also runs when no subcommand is given."""

    @app.callback(invoke_without_command=True, help=str(app.info.help))
    def alone(context: typer.Context, as_json: JsonOption = False) -> None:
        if context.invoked_subcommand is None:
            listing(as_json)

    app.command("list")(listing)


def print_json(value: object) -> None:
    """Prints one JSON document, as every `--json` does (docs/reference/json-output.md)."""
    unicode = (sys.stdout.encoding or "").lower().startswith("utf")
    typer.echo(json.dumps(value, indent=2, ensure_ascii=not unicode, allow_nan=False))


def json_entry(name: str, load: Callable[[str], "BaseModel"]) -> dict[str, object]:
    """Returns a list's entry for one file; an unreadable file has an `error` instead."""
    try:
        return {"name": name, **load(name).model_dump(mode="json")}
    except SlambedError as error:
        return {"name": name, "error": str(error)}
