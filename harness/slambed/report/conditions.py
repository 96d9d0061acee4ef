# SPDX-License-Identifier: Apache-2.0
"""Groups the runs of one figure: equal dataset and profile, one line per system."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from slambed.report.cells import text
from slambed.report.load import Results

RUNS_AVERAGED = 10
"""Most runs per cell in a curve over time: enough for a mean, bounded for large campaigns."""


@dataclass(frozen=True)
class Condition:
    """All runs with one dataset and one profile."""

    dataset: str
    profile: str
    runs: pd.DataFrame
    labels: tuple[str, ...]
    """Systems of the whole experiment in their order: one has the same color in every figure, also
    where others are missing."""

    def number(self, label: str) -> int:
        """Returns the place of a system among all, which gives its color."""
        return self.labels.index(label)

    @property
    def title(self) -> str:
        """Returns dataset and profile, for headings."""
        return f"{self.dataset}, {self.profile}" if self.profile else self.dataset

    def systems(self) -> Iterator[tuple[str, pd.DataFrame]]:
        """Yields label and runs of every system."""
        for label, rows in self.runs.groupby("label", sort=False):
            yield str(label), rows


def conditions_of(results: Results, all_runs: bool = False) -> list[Condition]:
    """Returns every condition in the order of the cells, of valid runs or of all."""
    runs = results.runs if all_runs else results.valid_runs
    labels = tuple(str(label) for label in results.runs["label"].drop_duplicates())
    return [
        Condition(text(dataset), text(profile), rows, labels)
        for (dataset, profile), rows in runs.groupby(
            ["dataset", "profile"], sort=False, dropna=False
        )
    ]


def typical_run(rows: pd.DataFrame, key: str = "ate_rmse_m") -> str | None:
    """Returns the key of the median run (of an even number the worse of the two in the middle), or
    of the first run if none has a value."""
    if not len(rows):
        return None
    values = pd.to_numeric(rows[key], errors="coerce").to_numpy(np.float64)
    known = np.flatnonzero(~np.isnan(values))
    if not len(known):
        return str(rows.iloc[0]["run_key"])
    ranked = known[np.argsort(values[known], kind="stable")]
    return str(rows.iloc[int(ranked[len(ranked) // 2])]["run_key"])


def median_run(rows: pd.DataFrame) -> str | None:
    """Returns the key of the middle run by coverage, then by ATE, of an even number the worse of
    the two in the middle. A run that failed counts as worse than any that did not."""
    if not len(rows):
        return None
    coverage = pd.to_numeric(rows["coverage"], errors="coerce").fillna(0.0)
    ate_m = pd.to_numeric(rows["ate_rmse_m"], errors="coerce").fillna(np.inf)
    ranked = np.lexsort((ate_m.to_numpy(np.float64), -coverage.to_numpy(np.float64)))
    return str(rows.iloc[int(ranked[len(ranked) // 2])]["run_key"])


def some_runs(rows: pd.DataFrame) -> list[str]:
    """Returns the first runs of a cell, at most RUNS_AVERAGED."""
    return [str(key) for key in rows["run_key"].head(RUNS_AVERAGED)]
