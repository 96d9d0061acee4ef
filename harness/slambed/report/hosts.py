# SPDX-License-Identifier: Apache-2.0
"""Shows which hosts executed the runs of a report, and how their results differ."""

import pandas as pd

from slambed.metrics.metric import Metric
from slambed.report.cells import estimate
from slambed.report.load import Results
from slambed.report.tables import Table, with_interval

MOST_METRICS = 5
NO_HOST = "(no host file)"


def host_table(results: Results, metrics: list[Metric]) -> Table | None:
    """Returns every cell once per host, with its first metrics; None if one host made all runs."""
    runs = results.runs
    if not mixes_hosts(runs):
        return None
    shown = metrics[:MOST_METRICS]
    rows: list[list[str]] = []
    for cell in results.cells():
        own = runs[runs["cell"].eq(cell)]
        for host, part in own.groupby(own["host"].fillna(NO_HOST), sort=True):
            good = part[part["valid"].eq(True)]
            values = [with_interval(item, estimate(good, item)) for item in shown]
            rows.append([str(cell), str(host), f"{len(good)}/{len(part)}", *values])
    return Table(
        "hosts",
        "The same by host. Each repetition of all combinations is made on one host (unless it "
        "failed), so differences between combinations are none between hosts",
        ["cell", "host", "runs", *(item.heading for item in shown)],
        rows,
        words=2,
    )


def mixes_hosts(runs: pd.DataFrame) -> bool:
    return bool(runs["host"].nunique(dropna=False) > 1)
