# SPDX-License-Identifier: Apache-2.0
"""All figures of an experiment; large campaigns get the figures that fit into the time allowed."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from slambed.metrics.catalog import keys_for
from slambed.metrics.metric import Use
from slambed.report.cells import Cell
from slambed.report.conditions import conditions_of
from slambed.report.figures.boxes import draw_metric
from slambed.report.figures.link import draw_rtt
from slambed.report.figures.losses import draw_losses, draw_losses_by_profile
from slambed.report.figures.paths import draw_paths
from slambed.report.figures.resources import CPU, MEMORY, draw_over_time
from slambed.report.figures.stages import draw_stages
from slambed.report.figures.sweep import draw_sweep, sweeps
from slambed.report.figures.tradeoff import PAIRS, draw_tradeoff
from slambed.report.load import Results
from slambed.report.style import FigureWriter, SavedFigure

TIME_FOR_FIGURES_S = 25.0
"""A report of any size must be there within a minute; `slambed plots --all` has no limit."""
CELLS_WITHOUT_LIMIT = 16
"""So few cells always get all their figures, however busy the machine is."""


@dataclass(frozen=True)
class Drawn:
    """The figures made, how many the time did not allow, and which had nothing to show."""

    figures: list[SavedFigure]
    left_out: int
    empty: list[str] = field(default_factory=list)


def draw_all(
    results: Results,
    cells: list[Cell],
    folder: Path,
    command: str,
    limit_s: float | None = TIME_FOR_FIGURES_S,
) -> Drawn:
    """Draws into `folder`; a figure that cannot be drawn is a problem of the results, not fatal."""
    writer = FigureWriter(folder, command, [])
    begin = time.monotonic()
    limited = limit_s is not None and len(cells) > CELLS_WITHOUT_LIMIT
    left_out = 0
    for name, draw in jobs_of(results, cells, writer):
        if limited and time.monotonic() - begin > (limit_s or 0):
            left_out += 1
            continue
        try:
            draw()
        except (ValueError, KeyError, TypeError, IndexError) as error:
            results.complain(f"figure {name} could not be drawn: {type(error).__name__}: {error}")
    writer.write_list()
    return Drawn(writer.saved, left_out, writer.empty)


def plots_asked(results: Results) -> list[str]:
    """What the experiment wants to see first: metrics and kinds of figures."""
    report = results.spec.get("report")
    asked = report.get("plots") if isinstance(report, dict) else None
    return [name for name in asked if isinstance(name, str)] if isinstance(asked, list) else []


def jobs_of(
    results: Results, cells: list[Cell], writer: FigureWriter
) -> list[tuple[str, Callable[[], object]]]:
    """Every figure with its kind, what the experiment asks for first."""
    asked = plots_asked(results)
    found = _jobs(results, cells, asked, writer)
    return sorted(found, key=lambda job: asked.index(job[0]) if job[0] in asked else len(asked))


def _jobs(
    results: Results, cells: list[Cell], asked: list[str], writer: FigureWriter
) -> Iterator[tuple[str, Callable[[], object]]]:
    """Most telling first: what comes last is what a large campaign goes without."""
    conditions = conditions_of(results)
    numbers = [key for key in asked if key in results.numbers()]
    for key in dict.fromkeys([*numbers, *keys_for(Use.DRAWN)]):
        yield key, partial(draw_metric, results, cells, results.metric(key), writer)
    for condition in conditions:
        yield "losses", partial(draw_losses, results, condition, writer)
        yield "trajectory", partial(draw_paths, results, condition, writer)
        yield "rtt", partial(draw_rtt, results, condition, writer)
        yield "cpu", partial(draw_over_time, results, condition, CPU, writer)
        yield "memory", partial(draw_over_time, results, condition, MEMORY, writer)
        yield "stages", partial(draw_stages, results, condition, writer)
    for _, variant, played, column, own in sweeps(results):
        yield "sweep", partial(draw_sweep, results, variant, played, column, own, writer)
    for (label, dataset), runs in results.trusted.groupby(["label", "dataset"], sort=False):
        if runs["profile"].nunique() > 1:
            yield (
                "losses_by_profile",
                partial(draw_losses_by_profile, results, str(label), str(dataset), runs, writer),
            )
    for dataset in dict.fromkeys(cell.dataset for cell in cells):
        for x, y in PAIRS:
            yield "tradeoff", partial(draw_tradeoff, cells, dataset, x, y, writer)
