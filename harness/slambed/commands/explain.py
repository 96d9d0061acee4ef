# SPDX-License-Identifier: Apache-2.0
"""`slambed explain`."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slambed.errors import SlambedError
from slambed.files.outputs import make_folder
from slambed.spec.experiment_name import name_of
from slambed.spec.selection import SYNTAX
from slambed.terminal import RESULTS, ResultsOption

if TYPE_CHECKING:
    from slambed.explain.picture import Window
    from slambed.explain.run_log import RunLog

FORMATS = (".png", ".svg", ".pdf")
PICTURES = "pictures"
"""Subfolder of the run's folder."""
AROUND_S = 2.0
"""Seconds shown before and after the time of `--around`."""
MOST_CELLS = 12
"""Combinations that an error line names."""
LEAST_DIGITS = 4
"""Of a run key: fewer do not name a run."""


def explain(
    run: Annotated[
        str,
        typer.Argument(help="Run folder, (the beginning of) a run key, or an experiment's name."),
    ],
    results: ResultsOption = RESULTS,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", help=f"Of an experiment, the median run of this: {SYNTAX}."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Timeline to write: .png, .svg or .pdf.")
    ] = None,
    begin: Annotated[float | None, typer.Option("--from", help="Run time in s.")] = None,
    end: Annotated[float | None, typer.Option("--to", help="Run time in s.")] = None,
    around: Annotated[
        str | None, typer.Option(help="'loss' (the first one) or a run time: 2 s on either side.")
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(
            "--slowest", min=1, help="Instead: so many frames that took longest, and why."
        ),
    ] = None,
    messages: Annotated[
        Path | None,
        typer.Option("--messages", help="Instead: .csv to write, a row per message of the run."),
    ] = None,
    path: Annotated[
        bool, typer.Option("--path", help="Draw its path over the true one instead.")
    ] = False,
    rerun: Annotated[
        bool, typer.Option("--rerun", help="--path, and a Rerun recording (needs rerun-sdk).")
    ] = False,
    sequence: Annotated[
        Path | None, typer.Option(help="--rerun: prepared sequence, for images.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder of all pictures; default: pictures/ beside the run's files."),
    ] = None,
) -> None:
    """Show what happened in one run: a timeline figure, and the story in text.

    Of an experiment it takes the median run, by coverage and then by ATE, which the report also
    shows; --only picks one combination of system, sequence, link and parameters.

    The timeline shows stages, messages in flight, states, RTT and track losses, for live and
    virtual runs. --around loss also shows why track was lost, with the images before and after if
    the sequence is prepared on this machine. --slowest lists the slowest frames, and whether they
    had more to compute, were throttled by their limits, stalled by the host, or queued; it draws
    nothing. --messages writes when each message was queued, sent and received, and its bytes.
    """
    from slambed.explain.loss_pictures import draw_loss, losses_in
    from slambed.explain.messages import write_messages
    from slambed.explain.picture import draw
    from slambed.explain.run_log import read_run
    from slambed.explain.slowest import report_lines, slowest
    from slambed.explain.story import story
    from slambed.metrics.losses import sentence

    if output is not None and (out is not None or path or rerun):
        raise SlambedError(
            "--output names the timeline alone; for the folder of all pictures, also of --path, "
            "give --out instead"
        )
    window_given = [begin is not None, end is not None, around is not None]
    if count is not None or messages is not None:
        others = (output, out, sequence, count if messages is not None else None)
        if path or rerun or any(window_given) or any(given is not None for given in others):
            option = "--messages" if messages is not None else "--slowest"
            raise SlambedError(f"{option} draws nothing; give it alone")
    if sequence is not None and not rerun:
        raise SlambedError("--sequence has the images of a recording; give it with --rerun")
    if (path or rerun) and any(window_given):
        option = "--rerun" if rerun else "--path"
        raise SlambedError(f"{option} shows the whole run; leave out --from, --to and --around")
    if around is not None and (begin is not None or end is not None):
        raise SlambedError("--around is a time window itself; leave out --from and --to")
    if (experiment := experiment_named(run, results)) is not None:
        median = median_run_of(experiment, only or ())
        typer.echo(f"run {median.key}: the median of {median.among} of {median.cell}")
        folder = median.folder
    elif only:
        raise SlambedError(
            f"--only picks a run of an experiment, and '{run}' is none in {results}; give the "
            "experiment's name, or the run without --only"
        )
    else:
        folder = find_run(run, results)
    if messages is not None:
        typer.echo(write_messages(read_run(folder), messages))
        return
    if count is not None:
        log = read_run(folder)
        for line in report_lines(log, slowest(log, count)):
            typer.echo(line)
        return
    if path or rerun:
        for drawn in draw_path(folder, out or folder / PICTURES, rerun, sequence):
            typer.echo(drawn)
        return
    log = read_run(folder)
    window = choose_window(log, begin, end, around)
    target = output or (out or folder / PICTURES) / "explain.png"
    if target.suffix not in FORMATS:
        raise SlambedError(f"unknown picture format {target}; known: {', '.join(FORMATS)}")
    if output is None:
        make_folder(target.parent, "--out")
    for line in story(log):
        typer.echo(line)
    if (begin is not None and begin < 0.0) or (end is not None and end > log.end_s):
        typer.echo(f"note: the run is from 0 to {log.end_s:.1f} s, there is nothing beyond")
    if around == "loss":
        for loss in losses_in(log)[:1]:  # empty when events report losses but no frames
            typer.echo(f"why it was lost at {loss.t_s:.2f} s ({loss.cause}): {sentence(loss)}")
            typer.echo(draw_loss(log, loss, target.with_stem(f"{target.stem}_loss")))
    draw(log, window, target)
    typer.echo(f"picture of {window.begin_s:.1f} to {window.end_s:.1f} s: {target}")


@dataclass(frozen=True)
class MedianRun:
    """The run that stands for a combination."""

    folder: Path
    key: str
    among: int
    """Number of valid runs with events."""
    cell: str
    """Name of the combination."""


def experiment_named(run: str, results: Path) -> Path | None:
    """Returns the folder of the experiment with this path or name; None if there is none."""
    places = (Path(run), results / name_of(run))
    return next((place for place in places if (place / "runs").is_dir()), None)


def find_run(run: str, results: Path) -> Path:
    """Returns a run folder by its path, its key, or the beginning of its key.

    Prefers the link inside an experiment's folder and does not resolve it, so that the path leads
    to the experiment. A run that several experiments share counts once. Raises SlambedError when no
    run or several match.
    """
    if (folder := Path(run)).is_dir():
        return folder.absolute()
    if len(run) >= LEAST_DIGITS:
        places = [*sorted(results.glob(f"*/runs/{run}*")), *sorted(results.glob(f"runs/{run}*"))]
        found: dict[str, Path] = {}
        for path in places:
            if path.is_dir():
                found.setdefault(path.name, path.absolute())
        if len(found) == 1:
            return next(iter(found.values()))
        if found:
            names = ", ".join(list(found)[:5])
            raise SlambedError(f"run '{run}' is not clear, {results}: {names}; give more digits")
    raise SlambedError(
        f"no run '{run}' in {results}; give a run folder, at least {LEAST_DIGITS} digits of a key "
        "(column run_key of an experiment's summary.csv), or an experiment's name"
    )


def median_run_of(experiment: Path, only: Sequence[str]) -> MedianRun:
    """Returns the run that the report shows for the selected combination. Raises SlambedError when
    the selection leaves several combinations, or no valid run with events."""
    from slambed.report.conditions import median_run
    from slambed.report.kept_events import with_events
    from slambed.report.load import load
    from slambed.report.selected import selected

    runs = selected(load(experiment), only, "--only")
    cells = runs.cells()
    if len(cells) > 1:
        more = f" and {len(cells) - MOST_CELLS} more" if len(cells) > MOST_CELLS else ""
        raise SlambedError(
            f"{experiment} has {len(cells)} combinations{' of that' if only else ''}, pick one "
            f"with --only: {', '.join(cells[:MOST_CELLS])}{more}"
        )
    explained = with_events(runs, runs.valid_runs)
    if (key := median_run(explained)) is None:
        raise SlambedError(f"{experiment}: no valid run of {', '.join(cells) or 'it'} has events")
    return MedianRun(runs.run_dir(key).absolute(), key, len(explained), cells[0])


def draw_path(folder: Path, out: Path, rerun: bool, sequence: Path | None) -> Iterator[Path]:
    """Draws the run's path over the ground truth, and writes a Rerun recording if `rerun`."""
    from slambed.explain.view import view_of, write_png, write_rerun

    found = view_of(folder)
    make_folder(out, "--out")
    yield write_png(found, out)
    if rerun:
        yield write_rerun(found, out / f"{found.run_key}.rrd", sequence)


def choose_window(
    log: "RunLog", begin: float | None, end: float | None, around: str | None
) -> "Window":
    """Returns the time window of the options; without options, the whole run."""
    from slambed.explain.picture import Window

    if around is not None:
        center_s = _center(log, around)
        if not 0.0 <= center_s <= log.end_s:
            raise SlambedError(f"--around {around} is outside the run, 0 to {log.end_s:.1f} s")
        return Window(max(0.0, center_s - AROUND_S), center_s + AROUND_S)
    begin_s = 0.0 if begin is None else begin
    end_s = log.end_s if end is None else end
    if end is not None and not end_s > begin_s:
        raise SlambedError(f"--to {end_s:g} is not after --from {begin_s:g}")
    if not begin_s < log.end_s or end_s <= 0.0:
        asked = f"--from {begin_s:g}" if end is None else f"{begin_s:g} to {end_s:g} s"
        raise SlambedError(f"{asked} is outside the run, 0 to {log.end_s:.1f} s")
    return Window(max(0.0, begin_s), min(end_s, log.end_s))


def _center(log: "RunLog", around: str) -> float:
    if around != "loss":
        try:
            return float(around)
        except ValueError:
            raise SlambedError(f"--around {around} is neither 'loss' nor seconds") from None
    losses = log.losses_s()
    if not losses:
        raise SlambedError("tracking was never lost in this run; give --around SECONDS")
    return losses[0]
