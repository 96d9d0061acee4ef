# SPDX-License-Identifier: Apache-2.0
"""The margin of one published number: from papers/*/paper.yaml, but reduced where it would hide an
ordering."""

from dataclasses import dataclass
from math import expm1, log

from slambed.metrics.comparison import holm
from slambed.papers.published import Contrast, Paper, PublishedCell
from slambed.papers.verdicts.contrasts import Step, paper_shows
from slambed.papers.verdicts.means import Kind
from slambed.papers.verdicts.model import LEVEL, Mean, Share
from slambed.papers.verdicts.shares import MARGIN, MARGIN_AT_THE_ENDS, NEAR_THE_END, can_be_shown

UNWRITTEN = 0.2
"""Fraction of a mean, where papers/*/paper.yaml has no margin for the metric."""


@dataclass(frozen=True)
class CellMargin:
    """A margin in the unit of the rules: a fraction (ratio, shares) or the paper's unit
    (difference)."""

    value: float
    kind: Kind
    why: str
    ordering_only: bool = False


def firm_contrasts(paper: Paper, cells: dict[str, PublishedCell]) -> list[Contrast]:
    """Returns the declared contrasts that the printed numbers alone show: counts of known runs, or
    means with spread and runs, Holm-adjusted per table. Our runs play no part."""
    found: dict[str, list[tuple[Contrast, float]]] = {}
    for contrast in paper.contrasts:
        steps = []
        for chain in contrast.chains if contrast.basis == "data" else []:
            printed = [_printed(paper, cells[name]) for name in chain if name in cells]
            if len(printed) == len(chain) and None not in printed:
                order = printed[::-1] if contrast.direction == "falls" else printed
                steps.append(Step((), tuple(p for p in order if p is not None)))
        if len(steps) == len(contrast.chains) and contrast.kind != "blocks":
            source = cells[contrast.chains[0][0]].source
            found.setdefault(source, []).append((contrast, paper_shows(steps)[0]))
    firm = []
    for entries in found.values():
        adjusted = holm([p for _, p in entries])
        firm += [c for (c, _), p in zip(entries, adjusted, strict=True) if p <= LEVEL]
    return firm


def _printed(paper: Paper, cell: PublishedCell) -> Share | Mean | None:
    metric = paper.metrics.get(cell.metric)
    value = published_of(cell, metric is not None and metric.statistic == "share")
    complete = isinstance(value, Share) or (
        value is not None and value.count is not None and value.sd is not None
    )
    return value if complete else None


def published_of(cell: PublishedCell, is_share: bool) -> Share | Mean | None:
    """Returns the published number as a count of runs or as a mean; None for a share of unknown
    runs."""
    if cell.value is None:
        return None
    if not is_share:
        return Mean(cell.value, cell.spread, cell.runs, cell.resolution or 0.0)
    if not cell.runs:
        return None
    bad = cell.value if cell.unit == "runs" else cell.value / 100 * cell.runs
    return Share(round(bad), cell.runs)


def ratio_of(paper: Paper, metric: str) -> float:
    """Returns the written margin of a metric as a ratio, or the usual one."""
    written = paper.margins.get(metric)
    return UNWRITTEN if written is None or written.ratio is None else written.ratio


def margin_of_cell(
    paper: Paper, cells: dict[str, PublishedCell], cell: PublishedCell, firm: list[Contrast]
) -> CellMargin:
    """Returns the written margin, but at most half of the smallest contrast that the paper shows
    with this cell; a larger margin could not tell neighbors apart. A share that would then need
    more than 300 runs is judged by its orderings only."""
    assert cell.value is not None or cell.claim is not None
    metric = paper.metrics.get(cell.metric)
    is_share = metric is not None and metric.statistic == "share"
    value = cell.value or 0.0
    if is_share and cell.unit == "runs" and cell.runs:
        value *= 100 / cell.runs
    written = paper.margins.get(cell.metric)
    if written is not None:
        ratio, size = written.ratio is not None, written.at(value)
        why = "as written in papers/"
    elif is_share:
        at_an_end = min(value, 100 - value) <= 100 * NEAR_THE_END
        ratio, size = False, 100 * (MARGIN_AT_THE_ENDS if at_an_end else MARGIN)
        why = "the usual one of shares"
    else:
        ratio, size, why = True, UNWRITTEN, "no margin is written for this metric, 20 % taken"
    half, contrast = _half_of_the_smallest(firm, cells, cell, ratio)
    if half < size:
        size, why = half, f"half of contrast {contrast}"
    if not is_share:
        return CellMargin(size, "ratio" if ratio else "difference", why)
    size /= 100
    if cell.runs and not can_be_shown(Share(round(value / 100 * cell.runs), cell.runs), size):
        why = f"300 runs would not show {100 * size:.3g} points ({why})"
        return CellMargin(size, "difference", why, ordering_only=True)
    return CellMargin(size, "difference", why)


def _half_of_the_smallest(
    firm: list[Contrast], cells: dict[str, PublishedCell], cell: PublishedCell, ratio: bool
) -> tuple[float, str]:
    smallest, name = float("inf"), ""
    for contrast in firm:
        if (half := _half(contrast, cells, cell, ratio)) < smallest:
            smallest, name = half, contrast.id
    return smallest, name


def _half(
    contrast: Contrast, cells: dict[str, PublishedCell], cell: PublishedCell, ratio: bool
) -> float:
    """Returns half the contrast between the ends of the chain, because a trend is about the whole
    chain."""
    found = float("inf")
    for chain in contrast.chains:
        ends = [cells[end].value for end in (chain[0], chain[-1]) if end in cells]
        if cell.id not in chain or len(ends) < 2 or None in ends:
            continue
        a, b = (float(v) for v in ends if v is not None)
        if a == b or (ratio and min(a, b) <= 0):
            continue
        half = expm1(abs(log(a / b)) / 2) if ratio else abs(a - b) / 2
        found = min(found, half)
    return found
