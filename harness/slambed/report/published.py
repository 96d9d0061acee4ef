# SPDX-License-Identifier: Apache-2.0
"""Comparison tables of an experiment beside the published figures it is about."""

from slambed.errors import SlambedError
from slambed.report.compare import compare_paper, comparison_table, tally
from slambed.report.load import Results
from slambed.report.lookup import pool_of
from slambed.report.papers import Paper, read_papers
from slambed.report.peer import peer_tables
from slambed.report.tables import Table


def comparisons_for(results: Results) -> list[Table]:
    """Peers that were measured like this experiment, and the tables and claims it `reproduces`."""
    try:
        papers = read_papers()
    except SlambedError as error:
        results.complain(str(error))
        return []
    pool = pool_of([results])
    if not len(pool.runs):
        return []
    tables = [table for p in papers if p.kind == "peer" for table in peer_tables(p, pool)]
    wanted = {str(name) for name in results.spec.get("reproduces") or []}
    for paper in papers:
        mine = _sources(paper, wanted)
        rows = [c for c in compare_paper(paper, pool) if c.source in mine] if mine else []
        if rows:
            caption = f"{paper.paper.title} ({paper.paper.year}): {tally(rows)}"
            tables.append(comparison_table(f"compare_{paper.id}", caption, rows))
    return tables


def _sources(paper: Paper, wanted: set[str]) -> set[str]:
    """Tables and claims named by id; a figure stands for the claims stated with it."""
    known = {table.id for table in paper.tables} | {claim.id for claim in paper.claims}
    by_figure = {s for figure in paper.figures if figure.id in wanted for s in figure.stated}
    return (wanted & known) | by_figure
