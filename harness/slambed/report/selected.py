# SPDX-License-Identifier: Apache-2.0
"""Selects finished runs as `--only` of run selects planned ones."""

from collections.abc import Iterable

import pandas as pd

from slambed.report.cells import text
from slambed.report.load import Results
from slambed.spec.selection import Facts, facts_of, meant


def selected(results: Results, texts: Iterable[str], option: str) -> Results:
    """Returns the runs that any of the selections matches; without selections all. Raises
    SlambedError for a selection without runs."""
    texts = tuple(texts)
    return results.only(meant(facts_of_runs(results.runs), texts, option)) if texts else results


def facts_of_runs(runs: pd.DataFrame) -> list[Facts]:
    """Returns what a selection may test, of every run."""
    params = [name for name in runs if str(name).startswith("params.")]
    found: list[Facts] = []
    for row in runs.to_dict("records"):
        own = {str(p).removeprefix("params."): row[p] for p in params if row[p] == row[p]}
        found.append(
            facts_of(
                text(row["cell"]),
                text(row["system"]),
                text(row["variant"]),
                [text(row["label"]), text(row["plain_label"])],
                text(row["dataset"]),
                text(row["profile"]),
                text(row["device_mobile"]),
                text(row["device_edge"]),
                text(row["engine"]),
                text(row["pace"]),
                own,
            )
        )
    return found
