# SPDX-License-Identifier: Apache-2.0
"""Draws all figures of an experiment; large campaigns get those that fit the time limit."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import pandas as pd

from slambed.metrics.catalog import keys_for
from slambed.metrics.metric import Use
from slambed.report.cells import Cell, metrics_asked
from slambed.report.conditions import conditions_of
from slambed.report.differences import differences
from slambed.report.figure_cache import FigureCache, files_of, made_of
from slambed.report.figures.boxes import draw_metric
from slambed.report.figures.changes import draw_changes
from slambed.report.figures.link import draw_rtt
from slambed.report.figures.losses import draw_losses, draw_losses_by_profile
from slambed.report.figures.paths import draw_paths
from slambed.report.figures.resources import CPU, MEMORY, draw_over_time
from slambed.report.figures.stages import draw_stages
from slambed.report.figures.sweep import draw_sweep, sweeps
from slambed.report.figures.swept import draw_swept, metrics_over, swept
from slambed.report.figures.tradeoff import PAIRS, draw_tradeoff
from slambed.report.load import Results
from slambed.report.style import FORMATS, FigureWriter, SavedFigure

TIME_FOR_FIGURES_S = 25.0
"""A report of any size must finish within a minute; `slambed report --all` has no limit."""
CELLS_WITHOUT_LIMIT = 16
"""Up to this many cells, the time limit does not apply."""


CHANGES = "changes"
"""Figure that is drawn only if an experiment asks for it."""


@dataclass(frozen=True)
class Drawn:
    """The figures drawn, how many the time limit left out, and which had nothing to show."""

    figures: list[SavedFigure]
    left_out: int
    empty: list[str] = field(default_factory=list)


def draw_all(
    results: Results,
    cells: list[Cell],
    folder: Path,
    command: str,
    limit_s: float | None = TIME_FOR_FIGURES_S,
    formats: tuple[str, ...] = FORMATS,
) -> Drawn:
    """Draws into `folder` every figure that does not exist for the same data. A figure that fails
    becomes a problem of the results."""
    writer = FigureWriter(folder, command, [], formats=formats)
    before = FigureCache(folder)
    begin = time.monotonic()
    limited = limit_s is not None and len(cells) > CELLS_WITHOUT_LIMIT
    left_out = 0
    for job in jobs_of(results, cells, writer):
        if before.keeps(job.made_of, results, writer):
            continue
        if limited and time.monotonic() - begin > (limit_s or 0):
            left_out += 1
            continue
        try:
            with before.notes(job.made_of, results, writer):
                job.draw()
        except (ValueError, KeyError, TypeError, IndexError) as error:
            results.complain(
                f"figure {job.kind} could not be drawn: {type(error).__name__}: {error}"
            )
    writer.write_list()
    before.write()
    return Drawn(writer.saved, left_out, writer.empty)


def plots_asked(results: Results) -> list[str]:
    """Returns the plots that the experiment asks for: metrics and kinds of figures."""
    report = results.spec.get("report")
    asked = report.get("plots") if isinstance(report, dict) else None
    return [name for name in asked if isinstance(name, str)] if isinstance(asked, list) else []


@dataclass(frozen=True)
class Job:
    """A figure, or several that are drawn together."""

    kind: str
    draw: Callable[[], object]
    made_of: str
    """Digest of all that it shows."""


def jobs_of(results: Results, cells: list[Cell], writer: FigureWriter) -> list[Job]:
    """Returns every figure, those that the experiment asks for first."""
    asked = plots_asked(results)
    found = _jobs(results, cells, asked, writer)
    return sorted(found, key=lambda job: asked.index(job.kind) if job.kind in asked else len(asked))


def _jobs(
    results: Results, cells: list[Cell], asked: list[str], writer: FigureWriter
) -> Iterator[Job]:
    """Yields the most informative figures first, because large campaigns go without the last
    ones."""
    draw: Callable[[], object]
    for found in swept(results):
        looks = [item.look for item in metrics_over(results, found)]
        draw = partial(draw_swept, results, found, writer)
        made = made_of(found.runs, "swept", found.axis.heading, found.dataset, *looks)
        yield Job("sweep", draw, made)
    numbers = [key for key in asked if key in results.numbers()]
    for key in dict.fromkeys([*numbers, *keys_for(Use.DRAWN)]):
        item = results.metric(key)
        draw = partial(draw_metric, results, cells, item, writer)
        yield Job(key, draw, made_of(_columns(results, key), "metric", item.look))
    for condition in conditions_of(results):
        runs = condition.runs
        made = made_of(runs, files_of(results, runs), *condition.labels)
        for kind, drawn in (
            ("losses", partial(draw_losses, results, condition, writer)),
            ("trajectory", partial(draw_paths, results, condition, writer)),
            ("rtt", partial(draw_rtt, results, condition, writer)),
            ("cpu", partial(draw_over_time, results, condition, CPU, writer)),
            ("memory", partial(draw_over_time, results, condition, MEMORY, writer)),
            ("stages", partial(draw_stages, results, condition, writer)),
        ):
            yield Job(kind, drawn, f"{kind} {made}")
    for sweep in sweeps(results):
        draw = partial(draw_sweep, sweep, writer)
        words = (sweep.variant, sweep.dataset, sweep.column, *sweep.apart)
        yield Job("sweep", draw, made_of(sweep.runs, "sweep", *words))
    for (label, dataset), runs in results.valid_runs.groupby(["label", "dataset"], sort=False):
        if runs["profile"].nunique() > 1:
            draw = partial(draw_losses_by_profile, results, str(label), str(dataset), runs, writer)
            yield Job("losses_by_profile", draw, made_of(runs, "losses_by_profile"))
    if CHANGES in asked:
        yield from _changes(results, writer)
    for dataset in dict.fromkeys(cell.dataset for cell in cells):
        for x, y in PAIRS:
            draw = partial(draw_tradeoff, cells, dataset, x, y, writer)
            yield Job("tradeoff", draw, made_of(_columns(results, x, y), "tradeoff", dataset, x, y))


def _changes(results: Results, writer: FigureWriter) -> Iterator[Job]:
    """Yields the figure of changes of the experiment's first metric. It is drawn on request only,
    because most experiments do not vary one thing at a time."""
    found = differences(results)
    keys = [d.metric.key for d in found]
    first = next((key for key in metrics_asked(results) if key in keys), None)
    for dataset in dict.fromkeys(d.dataset for d in found):
        own = [d for d in found if d.dataset == dataset and d.metric.key == first]
        if own:
            draw = partial(draw_changes, own, dataset, writer)
            yield Job(
                CHANGES, draw, made_of(_columns(results, own[0].metric.key), CHANGES, dataset)
            )


def _columns(results: Results, *keys: str) -> pd.DataFrame:
    """Returns the columns of the runs that figures over all cells show."""
    names = ("run_key", "cell", "label", "dataset", "profile", "valid", *keys)
    return results.runs[[name for name in names if name in results.runs]]
