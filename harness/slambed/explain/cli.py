# SPDX-License-Identifier: Apache-2.0
"""`slambed explain`."""

from pathlib import Path
from typing import Annotated

import typer

from slambed.campaign.find_run import find_run
from slambed.errors import SlambedError
from slambed.explain.loss_pictures import draw_loss, losses_in
from slambed.explain.picture import Window, draw
from slambed.explain.run_log import RunLog, read_run
from slambed.explain.story import story
from slambed.metrics.losses import sentence
from slambed.outputs import picture

FORMATS = (".png", ".svg", ".pdf")
AROUND_S = 2.0
"""Shown before and after what `--around` asks for."""


def explain(
    run: Annotated[str, typer.Argument(help="Run folder, or (the beginning of) a run key.")],
    results: Annotated[Path, typer.Option("--results", help="Folder of all results.")] = Path(
        "results"
    ),
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Picture: .png, .svg or .pdf.")
    ] = None,
    begin: Annotated[float | None, typer.Option("--from", help="Run time in s.")] = None,
    end: Annotated[float | None, typer.Option("--to", help="Run time in s.")] = None,
    around: Annotated[
        str | None, typer.Option(help="'loss' (the first one) or a run time: 2 s on either side.")
    ] = None,
) -> None:
    """Show what happened in one run: a time line picture, and its story in lines.

    Who computed what when, messages under way, states, RTT and track losses; live and virtual runs
    alike. --around loss also says why track was lost and shows the pictures on both sides of it,
    where the sequence is prepared here.
    """
    log = read_run(find_run(run, results))
    window = choose_window(log, begin, end, around)
    path = output or picture(f"explain_{log.folder.resolve().name}.png")
    if path.suffix not in FORMATS:
        raise SlambedError(f"unknown picture format {path}; known: {', '.join(FORMATS)}")
    for line in story(log):
        typer.echo(line)
    if (begin is not None and begin < 0.0) or (end is not None and end > log.end_s):
        typer.echo(f"note: the run is from 0 to {log.end_s:.1f} s, there is nothing beyond")
    if around == "loss":
        for loss in losses_in(log)[:1]:  # none where events tell losses but no frames
            typer.echo(f"why it was lost at {loss.t_s:.2f} s ({loss.cause}): {sentence(loss)}")
            typer.echo(draw_loss(log, loss, path.with_stem(f"{path.stem}_loss")))
    draw(log, window, path)
    typer.echo(f"picture of {window.begin_s:.1f} to {window.end_s:.1f} s: {path}")


def choose_window(
    log: RunLog, begin: float | None, end: float | None, around: str | None
) -> Window:
    """What the options ask for of the run; the whole of it when they ask for nothing."""
    if around is not None:
        centre_s = _centre(log, around)
        if not 0.0 <= centre_s <= log.end_s:
            raise SlambedError(f"--around {around} is outside the run, 0 to {log.end_s:.1f} s")
        return Window(max(0.0, centre_s - AROUND_S), centre_s + AROUND_S)
    begin_s = 0.0 if begin is None else begin
    end_s = log.end_s if end is None else end
    if end is not None and not end_s > begin_s:
        raise SlambedError(f"--to {end_s:g} is not after --from {begin_s:g}")
    if not begin_s < log.end_s or end_s <= 0.0:
        asked = f"--from {begin_s:g}" if end is None else f"{begin_s:g} to {end_s:g} s"
        raise SlambedError(f"{asked} is outside the run, 0 to {log.end_s:.1f} s")
    return Window(max(0.0, begin_s), min(end_s, log.end_s))


def _centre(log: RunLog, around: str) -> float:
    if around != "loss":
        try:
            return float(around)
        except ValueError:
            raise SlambedError(f"--around {around} is neither 'loss' nor seconds") from None
    losses = log.losses_s()
    if not losses:
        raise SlambedError("tracking was never lost in this run; give --around SECONDS")
    return losses[0]
