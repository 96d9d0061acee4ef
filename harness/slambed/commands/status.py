# SPDX-License-Identifier: Apache-2.0
"""`slambed status`."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from slambed.errors import ExitCode, SlambedError
from slambed.native import repository_root
from slambed.spec.experiment_name import YAML, must_be_an_experiment, name_of
from slambed.terminal import RESULTS, JsonOption, ResultsOption, console, print_json

if TYPE_CHECKING:
    from slambed.campaign.status import Status


def status(
    experiment: Annotated[
        str, typer.Argument(help="Name in experiments/, path of a YAML file, or of what was run.")
    ],
    results: ResultsOption = RESULTS,
    as_json: JsonOption = False,
) -> None:
    """Show which runs are valid, invalid or missing, and why."""
    from slambed.campaign.status import is_of, status_now, status_of, was_run
    from slambed.spec.library import Library
    from slambed.spec.software import host_software, image_software

    name = name_of(experiment)
    file = _file_of(experiment)
    before = was_run(results, name)
    if not before:
        must_be_an_experiment(experiment, Library().experiments())
    if not before or (file.is_file() and not is_of(results, name, file)):
        found = status_now(results, name, experiment)
    else:
        software = {image_software()}
        for program in ("slambed-node", "slambed-sim"):
            try:
                software.add(host_software(program=program))
            except SlambedError as error:
                typer.echo(f"note: {error}", err=as_json)
        found = status_of(results, name, file, software)
    if as_json:
        print_json(_document(name, found))
    else:
        _show(found)
    if found.cells or before:
        raise typer.Exit(ExitCode.OK if found.complete else ExitCode.NOT_ALL_GOOD)


def _file_of(experiment: str) -> Path:
    """Returns the path that the experiment's file would have; it may not exist."""
    given = Path(experiment)
    if given.suffix in YAML:
        return given
    return repository_root() / "experiments" / f"{experiment}.yaml"


def _document(name: str, found: "Status") -> dict[str, object]:
    content = {"cells": [asdict(cell) for cell in found.cells], "notes": found.notes}
    return {"experiment": name, "complete": found.complete, **content}


def _show(found: "Status") -> None:
    screen = console()
    if found.cells:
        screen.print(_table(found))
    for line in [
        *(f"invalid: {line}" for cell in found.cells for line in cell.invalid),
        *(f"note: {line}" if found.cells else line for line in found.notes),
    ]:
        screen.print(line, highlight=False, markup=False, soft_wrap=True)


def _table(found: "Status") -> Table:
    table = Table("cell", "valid", "invalid", "missing", box=None)
    for cell in found.cells:
        table.add_row(cell.cell, str(cell.valid), str(len(cell.invalid)), str(cell.missing))
    return table
