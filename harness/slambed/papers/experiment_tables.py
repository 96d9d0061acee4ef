# SPDX-License-Identifier: Apache-2.0
"""Tables that compare an experiment with the published numbers it reproduces."""

from slambed.errors import SlambedError
from slambed.papers.compare import compare_paper, comparison_table, ordering_table
from slambed.papers.lookup import pool_of, reproduces
from slambed.papers.peer import peer_tables
from slambed.papers.published import read_papers
from slambed.report.load import Results
from slambed.report.tables import Table


def comparisons_for(results: Results) -> list[Table]:
    """Returns tables of peers with this experiment's set-up, and of the tables and claims it
    `reproduces`."""
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
        if not mine:
            continue
        verdicts = compare_paper(paper, pool)
        ids = [i for i, cell in verdicts.cells.items() if cell.source in mine]
        for column in verdicts.columns if ids else []:
            table = comparison_table(verdicts, column, ids)
            table.name = f"compare_{paper.id}_{column.engine}"
            tables.append(table)
            orderings = ordering_table(verdicts, column)
            own = {o.contrast.id for o in column.orderings if _about(o.chains, mine)}
            orderings.rows = [row for row in orderings.rows if row[0] in own]
            orderings.name = f"orderings_{paper.id}_{column.engine}"
            if orderings.rows:
                tables.append(orderings)
    return tables


def _about(chains: object, sources: set[str]) -> bool:
    assert isinstance(chains, tuple)
    return all(cell.source in sources for chain in chains for cell, _ in chain)
