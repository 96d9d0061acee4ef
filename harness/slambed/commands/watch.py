# SPDX-License-Identifier: Apache-2.0
"""`slambed watch`."""

from __future__ import annotations

import json
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.live import Live

from slambed.errors import SlambedError
from slambed.spec.experiment_name import name_of
from slambed.terminal import RESULTS, ResultsOption, console

if TYPE_CHECKING:
    from slambed.campaign.watch import CampaignWatch, Watched

EVERY_S = 0.5


def watch(
    name: Annotated[
        str | None, typer.Argument(help="Experiment; whatever runs where none is named.")
    ] = None,
    results: ResultsOption = RESULTS,
    once: Annotated[bool, typer.Option("--once", help="Show how it is now, and end.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="The same as JSON; only with --once.")
    ] = False,
) -> None:
    """Watch running campaigns: the current runs, and the queue.

    Shows frames, tracking state, RTT and CPU of the current run from the files that it writes. The
    queue lists runs done, failed and left, with the time left. It only reads, and ends with the
    campaign or with Ctrl-C.
    """
    from slambed.campaign.watch import CampaignWatch, running
    from slambed.commands.watch_view import view

    if as_json and not once:
        raise SlambedError("--json is for one look; give --once, too")
    if not results.is_dir():
        raise SlambedError(f"no such folder: {results}; give the right --results")
    names = [_must_be_there(name_of(name), results)] if name else running(results)
    watches = [CampaignWatch(results / each) for each in names]
    found = _look(watches)
    alive = [watched for watched in found if watched.state.alive]
    if as_json:
        typer.echo(json.dumps({"campaigns": [asdict(w) for w in (found if name else alive)]}))
    elif not alive:
        typer.echo(_nothing(name, results, found))
    elif once:
        console().print(view(alive))
    else:
        _follow(watches, console())


def _must_be_there(name: str, results: Path) -> str:
    if not (results / name / "ledger.jsonl").is_file():
        raise SlambedError(f"no campaign of '{name}' has begun in {results}; see 'slambed run'")
    return name


def _nothing(name: str | None, results: Path, found: list[Watched]) -> str:
    from slambed.commands.watch_view import end_line

    if name is None:
        return f"nothing runs in {results}"
    if not found:
        return f"nothing runs; no campaign of {name} can be read in {results}"
    return f"nothing runs; the last campaign of {end_line(found[0].state)}"


def _look(watches: list[CampaignWatch]) -> list[Watched]:
    return [found for each in watches if (found := each.look()) is not None]


def _alive(watches: list[CampaignWatch]) -> list[Watched]:
    return [watched for watched in _look(watches) if watched.state.alive]


def _follow(watches: list[CampaignWatch], screen: Console) -> None:
    """Shows campaigns until all of them have ended."""
    from slambed.commands.watch_view import end_line, view

    try:
        if screen.is_terminal:
            with Live(console=screen, auto_refresh=False, transient=True) as live:
                while alive := _alive(watches):
                    live.update(view(alive), refresh=True)
                    time.sleep(EVERY_S)
        else:
            _print_changes(watches)
    except KeyboardInterrupt:
        return
    for watched in _look(watches):
        typer.echo(end_line(watched.state))


def _print_changes(watches: list[CampaignWatch]) -> None:
    """Prints a line for each change of a queue, for logs."""
    from slambed.commands.watch_view import queue_line

    reported: dict[str, tuple[int, int]] = {}
    while alive := _alive(watches):
        for state in (watched.state for watched in alive):
            if reported.get(state.experiment) != (counts := (state.done, state.failed)):
                reported[state.experiment] = counts
                typer.echo(f"{state.experiment}: {queue_line(state)}")
        time.sleep(EVERY_S)
