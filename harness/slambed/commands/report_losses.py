# SPDX-License-Identifier: Apache-2.0
"""`slambed report NAME --losses`."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import typer

from slambed.commands.shared_options import status_command
from slambed.errors import SlambedError
from slambed.metrics.losses import EVENTS, sentence
from slambed.report.kept_events import NONE_ARE_KEPT, from_part, with_events
from slambed.report.load import load
from slambed.report.loss_table import LostRun, all_by_cause, by_cause, every_loss, lost_runs
from slambed.report.tables import check_format, write_table
from slambed.terminal import console, print_json


def show_losses(folder: Path, experiment: str, output: Path | None, as_json: bool) -> None:
    """Prints the causes of each run's first loss and of all losses; writes a file with one loss per
    row."""
    if output is not None:
        check_format(output)
    found = load(folder)
    runs = lost_runs(found)
    if not runs and len(found.valid_runs):
        raise SlambedError(f"{experiment}: {NONE_ARE_KEPT}")
    if not runs:
        status = status_command(experiment, folder.parent)
        raise SlambedError(f"no valid run of {experiment}; '{status}' says why")
    if as_json:
        print_json({"experiment": folder.name, "runs": [_entry(run) for run in runs]})
    else:
        for table in (by_cause(runs), all_by_cause(runs)):
            console().print(table.rich())
        typer.echo("'slambed explain RUN --around loss' shows the first of a run")
    part = from_part(with_events(found, found.valid_runs, EVENTS), found.valid_runs)
    for note in [*([f"losses {part}"] if part else []), *found.problems]:
        typer.echo(f"note: {note}", err=as_json)
    if output is not None:
        write_table(every_loss(runs), output)
        typer.echo(f"every loss: {output}", err=as_json)


def _entry(run: LostRun) -> dict[str, Any]:
    losses = [{**asdict(loss), "why": sentence(loss)} for loss in run.losses]
    return {**asdict(run), "losses": losses}
