# SPDX-License-Identifier: Apache-2.0
"""Numbers that need a second run: the error of live poses against a reference system's."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from slambed.data.trajectory import Trajectory, read_tum
from slambed.errors import SlambedError
from slambed.metrics.reference_path import error_to_reference, reference_of
from slambed.report.load import Results

MOST_REFERENCES = 10
"""Most reference runs per sequence among which the reference is chosen."""


def reference_errors(
    results: Mapping[str, Results], runs: pd.DataFrame, references: pd.DataFrame
) -> "pd.Series[float]":
    """Returns the RMSE in meters of every run's live path to the reference run of its sequence,
    without alignment.

    `runs` and `references` have the columns `experiment_folder`, `run_key` and `dataset`. The value
    is NaN where a live path is missing or no timestamps match.
    """
    found: dict[object, float] = {}
    for dataset, own in runs.groupby("dataset"):
        paths = _paths(results, references[references["dataset"].eq(dataset)].head(MOST_REFERENCES))
        if not paths:
            continue
        reference = paths[reference_of(paths)]
        for index, row in own.iterrows():
            path = live_path(results, str(row["experiment_folder"]), str(row["run_key"]))
            if path is None:
                continue
            try:
                found[index] = error_to_reference(path, reference).rmse
            except SlambedError:
                continue
    return pd.Series([found.get(index, np.nan) for index in runs.index], runs.index, "float64")


def live_path(results: Mapping[str, Results], experiment: str, key: str) -> Trajectory | None:
    """Returns the live poses of a stored run, as estimated at the time of each frame; None without
    them."""
    folder = results[experiment].folder / "runs" / key
    for path in (folder / "mobile" / "trajectory_live.txt", folder / "trajectory_live.txt"):
        if path.is_file():
            try:
                found = read_tum(path)
            except SlambedError:
                return None
            return found if len(found) else None
    return None


def _paths(results: Mapping[str, Results], runs: pd.DataFrame) -> dict[str, Trajectory]:
    found = {}
    for folder, key in zip(runs["experiment_folder"], runs["run_key"], strict=True):
        path = live_path(results, str(folder), str(key))
        if path is not None:
            found[str(key)] = path
    return found
