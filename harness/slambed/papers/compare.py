# SPDX-License-Identifier: Apache-2.0
"""Compares a paper with our runs: every number and every declared ordering, per kind of engine."""

from collections import Counter
from dataclasses import dataclass

import pandas as pd

from slambed.papers.fits import DeviceFit, fits_used, read_fits
from slambed.papers.judged import MARK_NAMES, Judge, Judged, Mark, is_number
from slambed.papers.lookup import MISSING_WORDS, Pool
from slambed.papers.orderings import JudgedOrdering, judge_orderings
from slambed.papers.published import Paper, PublishedCell, cells_of
from slambed.papers.verdicts.prediction import Score, score
from slambed.report.tables import Table

CLAIMS = "claims"
"""Name of the group of numbers that are stated in the text."""


@dataclass(frozen=True)
class Column:
    """All verdicts from one kind of engine. Live and virtual runs are never pooled."""

    engine: str
    rows: dict[str, Judged]
    orderings: list[JudgedOrdering]
    fits: list[DeviceFit]
    runs: pd.DataFrame

    @property
    def score(self) -> Score:
        """Returns how well numbers outside every fit were predicted."""
        known = [r.position for r in self.rows.values() if r.position is not None]
        return score(known)

    def marks(self, ids: list[str]) -> "Counter[Mark]":
        return Counter(self.rows[i].mark for i in ids)


@dataclass(frozen=True)
class PaperVerdicts:
    """All verdicts on one paper."""

    paper: Paper
    cells: dict[str, PublishedCell]
    """The numbers that the paper prints, by id: the denominator of every count."""
    columns: list[Column]

    def groups(self) -> list[tuple[str, str, list[str]]]:
        """Returns (name, label, ids) of each table, then of the claims."""
        found = []
        for table in self.paper.tables:
            own = [i for i, c in self.cells.items() if c.source == table.id]
            if own:
                found.append((table.id, table.label, own))
        claims = [i for i, c in self.cells.items() if c.claim is not None]
        return [*found, (CLAIMS, "Text", claims)] if claims else found

    def column(self, engine: str) -> Column | None:
        return next((c for c in self.columns if c.engine == engine), None)


def compare_paper(paper: Paper, pool: Pool, fits: list[DeviceFit] | None = None) -> PaperVerdicts:
    """Judges every printed number and every declared ordering of a paper. Returns one column per
    kind of engine that has runs, or one empty column."""
    cells = cells_of(paper)
    numbers = {i: c for i, c in cells.items() if is_number(c)}
    fits = read_fits() if fits is None else fits
    columns = []
    pool = pool.of_paper(paper)
    for engine in pool.engines() or [""]:
        own = pool.of_engine(engine) if engine else pool
        used = fits_used(fits, own.runs)
        fitted = frozenset(i for i in cells if any(fit.has(i) for fit in used))
        judge = Judge(paper, own, cells, fitted)
        rows = {i: judge.judge(c) for i, c in numbers.items()}
        orderings = judge_orderings(judge)
        columns.append(Column(engine, _without_duplicates(rows), orderings, used, own.runs))
    return PaperVerdicts(paper, numbers, columns)


def _without_duplicates(rows: dict[str, Judged]) -> dict[str, Judged]:
    """Gives a number printed in two places one verdict, which both places show."""
    found = {}
    for name, row in rows.items():
        target = row.cell.comparability.duplicate_of
        if row.provenance == "duplicate" and target in rows:
            first = rows[str(target)]
            row = Judged(row.cell, "duplicate", first.verdict, first.measured, row.why)
        found[name] = row
    return found


def comparison_table(verdicts: PaperVerdicts, column: Column, ids: list[str]) -> Table:
    """Returns the numbers cell by cell, for CSV, Markdown and LaTeX."""
    engine = f" ({column.engine})" if column.engine else ""
    table = Table(
        "numbers",
        f"{verdicts.paper.paper.title}{engine}",
        ["where", "row", "column", "metric", "paper", "ours", "verdict", "provenance", "reason"],
        words=4,
    )
    for name in ids:
        row = column.rows[name]
        cell = row.cell
        outcome = row.verdict.outcome.replace("_", " ")
        reported = MISSING_WORDS[row.missing] if row.missing else outcome
        table.rows.append(
            [
                cell.id,
                cell.row,
                cell.column,
                cell.metric,
                row.stated,
                row.ours,
                reported if row.mark in "RDINE" else MARK_NAMES[row.mark],
                row.provenance.replace("_", " "),
                row.why,
            ]
        )
    return table


def ordering_table(verdicts: PaperVerdicts, column: Column) -> Table:
    """Returns the declared orderings, one per row."""
    engine = f" ({column.engine})" if column.engine else ""
    table = Table(
        "orderings",
        f"Declared orderings of {verdicts.paper.paper.title}{engine}",
        ["id", "statement", "paper", "ours", "outcome", "provenance", "reason", "pairs"],
        words=2,
    )
    for item in column.orderings:
        table.rows.append(
            [
                item.contrast.id,
                item.contrast.says,
                item.values(False),
                item.values(True),
                item.words,
                item.provenance.replace("_", " "),
                "; ".join(filter(None, (item.floor, item.why))),
                item.holding,
            ]
        )
    return table


def pair_table(verdicts: PaperVerdicts, column: Column) -> Table:
    """Returns every pair of the orderings with several pairs, one per row."""
    engine = f" ({column.engine})" if column.engine else ""
    table = Table(
        "pairs",
        f"Pairs of declared orderings of {verdicts.paper.paper.title}{engine}",
        ["id", "where", "paper", "ours", "outcome", "p"],
        words=2,
    )
    for item in column.orderings:
        table.rows += [
            [item.contrast.id, p.where, p.paper, p.ours, p.outcome, f"{p.p_value:.2g}"]
            for p in item.pairs
        ]
    return table


def plain_list(paper: Paper) -> str:
    """Returns one line with id, title and the count of numbers and orderings, or of set-ups."""
    source = paper.paper
    if paper.kind == "peer":
        return f"{paper.id}: {source.title}, {len(paper.setups)} set-ups"
    numbers = sum(is_number(c) for c in cells_of(paper).values())
    return (
        f"{paper.id}: {source.title} ({source.year}), {numbers} printed numbers, "
        f"{len(paper.contrasts)} declared orderings"
    )
