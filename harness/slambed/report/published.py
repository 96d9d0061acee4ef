# SPDX-License-Identifier: Apache-2.0
"""Comparison tables of an experiment beside the published figures it is about."""

from slambed.errors import SlambedError
from slambed.report.compare import compare_paper, comparison_table, tally
from slambed.report.load import Results
from slambed.report.lookup import pool_of, reproduces
from slambed.report.papers import read_papers
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
    wanted = reproduces(results)
    for paper in papers:
        mine = paper.sources(wanted)
        rows = [c for c in compare_paper(paper, pool) if c.source in mine] if mine else []
        if rows:
            caption = f"{paper.paper.title} ({paper.paper.year}): {tally(rows)}"
            tables.append(comparison_table(f"compare_{paper.id}", caption, rows))
    return tables
