# SPDX-License-Identifier: Apache-2.0
"""What each experiment decides about the papers, and the order in which a campaign plays them."""

from collections.abc import Mapping
from dataclasses import dataclass

from slambed.papers.compare import PaperVerdicts, compare_paper
from slambed.papers.lookup import pool_of
from slambed.papers.orderings import JudgedOrdering
from slambed.papers.published import Paper, cells_of
from slambed.papers.published.paper_plan import read_plan
from slambed.report.load import Results

DECIDED = ("holds", "reversed", "not_seen", "not_shown_by_paper")
"""Outcomes of an ordering that more runs are not waited for."""


@dataclass(frozen=True)
class Decides:
    """What the runs of one experiment are needed for."""

    main: int = 0
    """Main claims."""
    orderings: int = 0
    """All declared orderings, main claims included."""
    numbers: int = 0
    """Printed numbers in the tables, figures and claims that it reproduces."""

    def __add__(self, other: "Decides") -> "Decides":
        return Decides(
            self.main + other.main,
            self.orderings + other.orderings,
            self.numbers + other.numbers,
        )


def decides(paper: Paper, experiment: str, reproduces: set[str]) -> Decides:
    """Returns what an experiment decides about a paper: the orderings that the paper's plan names
    for it, or those with a cell in what it reproduces if the plan does not name it."""
    sources = paper.sources(reproduces)
    cells = cells_of(paper)
    numbers = sum(cell.source in sources and cell.value is not None for cell in cells.values())
    plan = read_plan(paper.id) if paper.kind == "paper" else None
    planned = [item for item in plan.runs if item.experiment == experiment] if plan else []
    if planned:
        named = {name for item in planned for name in item.decides}
        orderings = [item for item in paper.contrasts if item.id in named]
    else:
        orderings = [
            item
            for item in paper.contrasts
            if any(cell in cells and cells[cell].source in sources for cell in item.ids())
        ]
    return Decides(sum(item.main for item in orderings), len(orderings), numbers)


def in_order(found: Mapping[str, Decides], cost_s: Mapping[str, float]) -> list[str]:
    """Returns the experiments in the order in which they are played: first those that decide a main
    claim, then those that decide another ordering, then the others; of each group first what
    decides most per hour."""

    def rank(name: str) -> tuple[int, float, str]:
        item = found[name]
        group = 0 if item.main else 1 if item.orderings else 2
        worth = (item.main, item.orderings, item.numbers)[group]
        return group, max(cost_s[name], 1.0) / max(worth, 1), name

    return sorted(found, key=rank)


def decided_words(papers: list[Paper], experiments: list[Results]) -> str:
    """Returns `14 of 60 orderings decided, ours beside 63 of 433 numbers` over all papers. A number
    counts when a value of ours stands beside it, of whichever engine."""
    orderings = numbers = all_orderings = all_numbers = 0
    pool = pool_of(experiments)
    for paper in papers:
        if paper.kind != "paper":
            continue
        verdicts = compare_paper(paper, pool)
        all_orderings += len(paper.contrasts)
        all_numbers += len(verdicts.cells)
        orderings += sum(
            any(_is_decided(column.orderings[i]) for column in verdicts.columns)
            for i in range(len(paper.contrasts))
        )
        numbers += len(numbers_with_ours(verdicts))
    return (
        f"{orderings} of {all_orderings} orderings decided, "
        f"ours beside {numbers} of {all_numbers} numbers"
    )


def numbers_with_ours(verdicts: PaperVerdicts) -> set[str]:
    """Returns the printed numbers beside which a value of ours stands."""
    return {
        name
        for column in verdicts.columns
        for name, row in column.rows.items()
        if row.measured.there
    }


def _is_decided(ordering: JudgedOrdering) -> bool:
    return ordering.kind in DECIDED and ordering.begun
