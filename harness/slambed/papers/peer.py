# SPDX-License-Identifier: Apache-2.0
"""Compares our program with another one on the same frames: ratios, and whether they meet the
target."""

from slambed.data.stand_in import played_instead
from slambed.metrics.catalog import metric
from slambed.metrics.statistics import finite, interval
from slambed.papers.lookup import Pool, matching
from slambed.papers.published import Paper, PeerSetup
from slambed.report.tables import Table, around


def peer_tables(paper: Paper, pool: Pool) -> list[Table]:
    """Returns one table per set-up that we have runs of."""
    tables = (_table(paper, name, setup, pool) for name, setup in paper.setups.items())
    return [table for table in tables if table is not None]


def _table(paper: Paper, name: str, setup: PeerSetup, pool: Pool) -> Table | None:
    runs = matching(pool.runs, setup.match)
    if not len(runs):
        return None
    others = sorted({str(played) for played in runs["dataset"]} - {setup.dataset})
    instead = f"{played_instead(' and '.join(others), setup.dataset)}. " if others else ""
    table = Table(
        f"{paper.id}_{name}",
        f"{instead}Ours beside the original ({setup.label}); intervals are 95 % of the median, "
        "in parentheses ranges of fewer than 6 runs",
        [
            "figure",
            "original: min / median / max",
            "ours",
            "interval",
            "runs",
            "ratio",
            "aim",
            "verdict",
        ],
    )
    for key, row in setup.rows.items():
        item = metric(key)
        theirs = " / ".join(item.show(v) for v in (row.low, row.value, row.high))
        heading = item.heading + (f" ({row.note})" if row.note else "")
        values = finite(runs[key].to_numpy()) if key in runs else finite([])
        if not len(values):
            table.rows.append([heading, theirs, "-", "-", "0", "-", "-", "not run"])
            continue
        ours = interval(values)
        ratio = ours.value / row.value
        verdict = "-"
        if others:
            verdict = "not compared"
        elif row.target is not None:
            verdict = "met" if ratio <= row.target else "missed"
            if ratio < 1 and ours.high < row.low:
                verdict = "better"
        aim = f"≤ {row.target:g}" if row.target and not others else "-"
        table.rows.append(
            [
                heading,
                theirs,
                item.show(ours.value),
                around(item.show, ours),
                str(ours.count),
                "-" if others else f"{ratio:.2f}",
                aim,
                verdict,
            ]
        )
    return table
