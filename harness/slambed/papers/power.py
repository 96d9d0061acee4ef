# SPDX-License-Identifier: Apache-2.0
"""Predicts before a campaign what it can decide about a paper, and what it costs."""

from dataclasses import dataclass
from datetime import datetime
from math import fsum
from pathlib import Path

import numpy as np

from slambed.campaign.ledger import Ledger
from slambed.papers.judged import Judge, is_number
from slambed.papers.lookup import pool_of
from slambed.papers.margins import margin_of_cell, published_of
from slambed.papers.orderings import OrderingCase, papers_p_values
from slambed.papers.published import Paper, PublishedCell, cells_of
from slambed.papers.published.paper_plan import PaperPlan
from slambed.papers.verdicts import means, shares
from slambed.papers.verdicts.contrasts import (
    USUAL_CV,
    power_of,
    runs_to_show,
)
from slambed.papers.verdicts.model import LEVEL, SEEN_POWER, Share
from slambed.report.tables import Table

RUNS = (10, 30, 100, 300)


def ordering_powers(paper: Paper, runs: tuple[int, ...] = RUNS) -> Table:
    """Returns the chance that each declared ordering holds, if the paper's numbers are true."""
    judge = Judge(paper, pool_of([]), cells_of(paper), frozenset())
    cases = [OrderingCase(judge, contrast) for contrast in paper.contrasts]
    adjusted = papers_p_values(cases)
    table = Table(
        "powers",
        "Chance that an ordering holds with so many runs per combination, if the paper is right "
        f"(before a run: spread assumed, {USUAL_CV:.0%} of a mean; a page takes that of its runs)",
        [
            "ordering",
            "statement",
            *(str(n) for n in runs),
            f"runs for {SEEN_POWER:.0%}",
            "paper shows it",
        ],
        words=2,
    )
    for case in cases:
        contrast, p_paper = case.contrast, adjusted.get(case.contrast.id)
        says = contrast.says + (" (main)" if contrast.main else "")
        if p_paper is None or contrast.kind == "blocks":
            why = "in words only" if contrast.basis == "text" else "no test of single numbers"
            table.rows.append([contrast.id, says, *("-" for _ in runs), "-", why])
            continue
        steps = case.steps()
        powers = [power_of(steps, [[n] * len(s.paper) for s in steps]) for n in runs]
        needed = runs_to_show(steps)
        shown = f"{'yes' if p_paper <= LEVEL else 'NO'} (p {p_paper:.2g})"
        texts = [f"{power:.2f}" for power in powers]
        table.rows.append([contrast.id, says, *texts, str(needed or "above 300"), shown])
    return table


def number_powers(paper: Paper, runs: tuple[int, ...] = RUNS) -> Table:
    """Returns how many numbers of each table would be reproduced on the paper's own sequences if
    our system is the same: the sum of their chances."""
    cells = cells_of(paper)
    judge = Judge(paper, pool_of([]), cells, frozenset())
    table = Table(
        "numbers",
        "Numbers that would be reproduced with so many runs per combination, if ours is the "
        f"same system on the same sequence (spread assumed: {USUAL_CV:.0%} of a mean)",
        ["table", "to be judged", *(str(n) for n in runs)],
    )
    for item in paper.tables:
        own = [c for c in cells.values() if c.source == item.id and _judged(c)]
        chances = [[_chance(judge, c, n) for c in own] for n in runs]
        table.rows.append([item.label, str(len(own)), *(f"{fsum(c):.1f}" for c in chances)])
    return table


def _judged(cell: PublishedCell) -> bool:
    return is_number(cell) and cell.comparability.judged


def _chance(judge: Judge, cell: PublishedCell, runs: int) -> float:
    metric = judge.paper.metrics.get(cell.metric)
    published = published_of(cell, metric is not None and metric.statistic == "share")
    if metric is None or published is None:
        return 0.0
    margin = margin_of_cell(judge.paper, judge.cells, cell, judge.firm)
    if margin.ordering_only:
        return 0.0
    if isinstance(published, Share):
        return shares.chance_to_reproduce(published, runs, margin.value)
    return means.chance_to_reproduce(published, USUAL_CV, runs, margin.value, margin.kind)


@dataclass(frozen=True)
class Cost:
    """What one experiment costs."""

    experiment: str
    cells: int
    runs: int
    minutes: float
    measured: bool

    def row(self) -> list[str]:
        how = "measured here" if self.measured else "assumed"
        return [self.experiment, str(self.cells), str(self.runs), str(self.cells * self.runs),
                f"{self.minutes:.0f}", how]  # fmt: skip


VIRTUAL_SHARE = 0.1
"""Fraction of the played time that a virtual run takes, if none was measured."""


def costs(
    paper: Paper,
    experiments: dict[str, tuple[int, int, float]],
    plan: PaperPlan | None,
    results: Path,
    jobs: int,
) -> Table:
    """Returns runs and minutes per experiment; `experiments` has (cells, runs per cell, played
    seconds) of each. A plan's runs per cell take precedence."""
    planned = {item.experiment: item.runs for item in plan.runs} if plan is not None else {}
    found = []
    for name, (cells, usual, played_s) in experiments.items():
        runs = planned.get(name, usual)
        per_run = seconds_per_run(results / name / "ledger.jsonl")
        seconds = per_run if per_run is not None else played_s * VIRTUAL_SHARE / jobs
        minutes = cells * runs * seconds / 60
        found.append(Cost(name, cells, runs, minutes, per_run is not None))
    total = fsum(cost.minutes for cost in found)
    source = f"plan {plan.digest}" if plan is not None else "the experiments' own numbers of runs"
    caption = (
        f"Virtual runs by {source}: {sum(c.cells * c.runs for c in found)} in {total / 60:.1f} h; "
        f"assumed is {VIRTUAL_SHARE:.0%} of the played time on each of {jobs} processes"
    )
    table = Table(
        "costs", caption, ["experiment", "combinations", "runs of each", "runs", "minutes", "times"]
    )
    table.rows = [cost.row() for cost in found]
    return table


def seconds_per_run(ledger: Path) -> float | None:
    """Returns the wall time in s between finished runs of a campaign over all processes, a trimmed
    mean of its ledger; None with fewer than five runs."""
    times = [
        datetime.fromisoformat(str(entry["time_utc"])).timestamp()
        for entry in Ledger(ledger).read()
        if entry.get("event") == "run_finished" and "time_utc" in entry
    ]
    if len(times) < 5:
        return None
    # Trimming a tenth at each end removes the few long gaps between campaigns.
    gaps = np.sort(np.diff(np.sort(times)))
    cut = len(gaps) // 10
    return float(gaps[cut : len(gaps) - cut].mean())
