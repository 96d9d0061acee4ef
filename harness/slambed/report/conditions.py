# SPDX-License-Identifier: Apache-2.0
"""Which runs belong into one figure: equal dataset and profile, one line per system."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from slambed.report.cells import text
from slambed.report.load import Results

RUNS_AVERAGED = 10
"""Runs per cell that a curve over time is made of: enough for a mean, bounded for big campaigns."""


@dataclass(frozen=True)
class Condition:
    """All runs that count with one dataset and one profile."""

    dataset: str
    profile: str
    runs: pd.DataFrame

    @property
    def title(self) -> str:
        """Dataset and profile, for headings."""
        return f"{self.dataset}, {self.profile}" if self.profile else self.dataset

    def systems(self) -> Iterator[tuple[str, pd.DataFrame]]:
        """Label and runs of every system."""
        for label, rows in self.runs.groupby("label", sort=False):
            yield str(label), rows


def conditions_of(results: Results, all_runs: bool = False) -> list[Condition]:
    """Every condition in the order of the cells."""
    runs = results.runs if all_runs else results.valid_runs
    return [
        Condition(text(dataset), text(profile), rows)
        for (dataset, profile), rows in runs.groupby(
            ["dataset", "profile"], sort=False, dropna=False
        )
    ]


def typical_run(rows: pd.DataFrame, key: str = "ate_rmse_m") -> str | None:
    """The run whose value is nearest to the median (lower one of two); any run if none has it."""
    if not len(rows):
        return None
    values = pd.to_numeric(rows[key], errors="coerce").to_numpy(np.float64)
    known = np.flatnonzero(~np.isnan(values))
    if not len(known):
        return str(rows.iloc[0]["run_key"])
    ranked = known[np.argsort(values[known], kind="stable")]
    return str(rows.iloc[int(ranked[(len(ranked) - 1) // 2])]["run_key"])


def some_runs(rows: pd.DataFrame) -> list[str]:
    """The first runs of a cell, at most RUNS_AVERAGED."""
    return [str(key) for key in rows["run_key"].head(RUNS_AVERAGED)]
