# SPDX-License-Identifier: Apache-2.0
"""Checks that the numbers of a folder are comparable: one version of the metrics, one ground
truth."""

import hashlib
from pathlib import Path

import pandas as pd

from slambed.metrics.catalog import own_of, version_for
from slambed.metrics.metric import Metric

REMEDY = "'slambed report {name} --again' computes them from the stored events"


def described(runs: pd.DataFrame) -> "pd.Series[str]":
    """Returns the key of each run's system description, or the system's name if unknown."""
    return runs["described"] if "described" in runs else runs["system"]


def own_metrics_in(runs: pd.DataFrame) -> dict[str, Metric]:
    """Returns the own metrics of all systems of these runs by key."""
    known = "described" in runs or "system" in runs
    return own_of(described(runs).dropna().unique()) if known else {}


def refused_runs(runs: pd.DataFrame, truths: dict[str, Path]) -> dict[str, str]:
    """Maps a run key to why its numbers must not be mixed with the others'.

    If all runs have one old version, they are not mixed. `truths` maps a dataset to the ground
    truth stored with the runs; runs without a digest are not checked.
    """
    if not len(runs):
        return {}
    refused: dict[str, str] = {}
    versions = runs["metrics_version"].fillna("1").astype(str)
    today = described(runs).map(version_for)
    if versions.ne(today).any() and not _one_version(versions, runs["system"]):
        old = versions != today
        for key, version, now in zip(runs["run_key"][old], versions[old], today[old], strict=True):
            base = version.partition("+")[0]
            shown = base if base != now.partition("+")[0] else version
            refused[str(key)] = f"its numbers are of metrics version {shown}"
    digests = {name: _digest(path) for name, path in truths.items() if path.is_file()}
    known = runs[runs["groundtruth"].notna() & runs["dataset"].isin(list(digests))]
    for key, dataset, digest in zip(
        known["run_key"], known["dataset"], known["groundtruth"], strict=True
    ):
        if digests[dataset] != digest:
            refused[str(key)] = "it was judged by another ground truth"
    return refused


def old_version(runs: pd.DataFrame) -> str | None:
    """Returns the version of all runs if it is not today's."""
    if not len(runs):
        return None
    versions = runs["metrics_version"].fillna("1").astype(str)
    return str(versions.iloc[0]) if versions.ne(described(runs).map(version_for)).any() else None


def _one_version(versions: pd.Series, systems: pd.Series) -> bool:
    """Returns whether all runs share the version of the list, and all runs of a system that of its
    own metrics."""
    base = versions.str.partition("+")[0]
    return base.nunique() == 1 and bool((versions.groupby(systems).nunique() <= 1).all())


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]
