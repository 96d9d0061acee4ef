# SPDX-License-Identifier: Apache-2.0
"""Whether the numbers of a folder may stand beside each other: one version of the metrics, one true
path."""

import hashlib
from pathlib import Path

import pandas as pd

from slambed.metrics.catalog import version_for

REMEDY = "'slambed report {name} --again' computes them from the stored events"


def described(runs: pd.DataFrame) -> "pd.Series[str]":
    """What finds the description of each run's system; its name where nothing else is known."""
    return runs["described"] if "described" in runs else runs["system"]


def refused_runs(runs: pd.DataFrame, truths: dict[str, Path]) -> dict[str, str]:
    """Run key -> why its numbers must not be mixed with the others'.

    Where all runs are of one version, an old one is no mixture. `truths`: dataset -> the true path
    that is kept beside the runs; a run that knows no digest of its own is not asked.
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
    """The version of all runs, where it is not today's."""
    if not len(runs):
        return None
    versions = runs["metrics_version"].fillna("1").astype(str)
    return str(versions.iloc[0]) if versions.ne(described(runs).map(version_for)).any() else None


def _one_version(versions: pd.Series, systems: pd.Series) -> bool:
    """The same version of the list in all runs, and of a system's own metrics in all of its."""
    base = versions.str.partition("+")[0]
    return base.nunique() == 1 and bool((versions.groupby(systems).nunique() <= 1).all())


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]
