# SPDX-License-Identifier: Apache-2.0
"""Computes numbers per cell: estimates with intervals, and notes on groups in the data."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from slambed.metrics.catalog import keys_for, metric
from slambed.metrics.comparison import power_hint, two_modes
from slambed.metrics.metric import Metric, Use
from slambed.metrics.robust_accuracy import LEAST_COVERAGE, coverage_aware_ate
from slambed.metrics.statistics import Interval, finite, interval, wilson
from slambed.report.load import Results

MOST_FAULTS = 3
"""Most descriptions of faults per cell, the most frequent first."""


@dataclass(frozen=True)
class Cell:
    """All runs of one condition."""

    name: str
    label: str
    dataset: str
    profile: str
    runs: int
    valid: int
    """Number of valid runs."""
    faults: str
    """Injected faults of its runs; empty without any."""
    values: dict[str, Interval]
    """By metric key; a metric without any measured value is absent."""
    notes: list[str]
    hosts: str = ""
    """Hosts with their valid runs, if several hosts made the runs of the report."""


def metrics_to_show(results: Results) -> list[Metric]:
    """Returns the experiment's metrics first, then the usual ones; only those measured in some run.
    The share of failed runs, where there are any, follows the ATE, which flatters them.

    Text values are left out; notes of the cells have them.
    """
    keys = dict.fromkeys([*metrics_asked(results), *keys_for(Use.SHOWN)])
    runs, numbers = results.valid_runs, results.numbers()
    if not runs["not_completed"].eq(True).any():
        keys.pop("not_completed", None)
    if "ate_rmse_m" in keys and runs["failed"].eq(True).any():
        keys = dict.fromkeys(f for k in keys for f in ([k, "failed"] if k == "ate_rmse_m" else [k]))
    return [results.metric(k) for k in keys if k in numbers and len(finite(runs[k].to_numpy()))]


def metrics_asked(results: Results) -> list[str]:
    """Returns the metrics that the experiment names; with `track_losses` also the share of runs
    with one."""
    report = results.spec.get("report")
    asked = report.get("metrics") if isinstance(report, dict) else None
    asked = [key for key in asked if isinstance(key, str)] if isinstance(asked, list) else []
    return list(dict.fromkeys([*("lost" if k == "track_losses" else k for k in asked), *asked]))


def cells_of(results: Results, metrics: list[Metric]) -> list[Cell]:
    """Returns every cell in order, with the estimates of its valid runs."""
    groups = {name: rows for name, rows in results.runs.groupby("cell", sort=False)}
    mixed = results.runs["host"].nunique(dropna=False) > 1
    return [_cell(name, groups[name], metrics, mixed) for name in results.cells()]


def _cell(name: str, rows: pd.DataFrame, metrics: list[Metric], mixed: bool) -> Cell:
    good = rows[rows["valid"].eq(True)]
    first = rows.iloc[0]
    values: dict[str, Interval] = {}
    notes: list[str] = []
    for item in metrics:
        if (found := estimate(good, item)) is not None:
            values[item.key] = found
        notes += _groups_note(good, item)
    reasons = rows.loc[~rows["valid"].eq(True), "invalid_reason"].astype(str).value_counts()
    notes += [f"{count} invalid: {reason}" for reason, count in reasons.items()]
    notes += _outcome_notes(good)
    notes += _coverage_note(good)
    notes += _scale_note(good)
    return Cell(
        name=name,
        label=str(first["label"]),
        dataset=text(first["dataset"]),
        profile=text(first["profile"]) or "no link",
        runs=len(rows),
        valid=len(good),
        faults=_faults(rows),
        values=values,
        notes=notes,
        hosts=hosts_of(good) if mixed else "",
    )


def hosts_of(rows: pd.DataFrame) -> str:
    """Returns `lab1:10, lab2:10`, with a dash for runs without a hosts file."""
    counts = rows["host"].fillna("-").value_counts().sort_index()
    return ", ".join(f"{host}:{count}" for host, count in counts.items())


def _outcome_notes(rows: pd.DataFrame) -> list[str]:
    """Returns notes on runs that did not complete, with the most frequent reason."""
    notes: list[str] = []
    for outcome, runs in rows[rows["not_completed"].eq(True)].groupby("outcome", sort=False):
        reasons = runs["outcome_reason"].dropna().astype(str).value_counts()
        message = f": {reasons.index[0]}" if len(reasons) else ""
        notes.append(f"{len(runs)} of {len(rows)} runs {str(outcome).replace('_', ' ')}{message}")
    return notes


def _faults(rows: pd.DataFrame) -> str:
    """Returns the distinct faults; live runs of a cell may differ by some tenths of a second."""
    found = list(rows["faults"].dropna().astype(str).value_counts().index)
    more = len(found) - MOST_FAULTS
    return "; ".join(found[:MOST_FAULTS]) + (f"; {more} more" if more > 0 else "")


def text(value: object) -> str:
    """Returns a value as text, empty for null."""
    return "" if value is None or value != value else str(value)


def estimate(rows: pd.DataFrame, item: Metric) -> Interval | None:
    """Returns a share with Wilson's interval, or a median with its interval; None if not
    measured."""
    if item.key not in rows:
        return None
    values = finite(rows[item.key].to_numpy())
    if len(values) == 0:
        return None
    if item.kind == "share":
        return wilson(int((values > 0).sum()), len(values))
    return interval(values)


def intervals_or_ranges(values: Iterable[Interval]) -> str:
    """Returns what a figure draws around these estimates, for its caption."""
    ranges = {value.is_range for value in values}
    if ranges == {True}:
        return "the range of fewer than 6 runs"
    return "95 % intervals" + (", or the range of fewer than 6 runs" if True in ranges else "")


def _groups_note(rows: pd.DataFrame, item: Metric) -> list[str]:
    """Returns a note on two groups of runs, which one median would hide."""
    if item.kind == "share" or item.key not in rows:
        return []
    modes = two_modes(rows[item.key].to_numpy())
    if modes is None:
        return []
    return [
        f"{item.name}: two groups, {modes.low_count} runs near {item.show(modes.low_median)} and "
        f"{modes.high_count} near {item.show(modes.high_median)} {item.shown_unit}".rstrip()
    ]


def _coverage_note(rows: pd.DataFrame) -> list[str]:
    """Returns a note with the median over all runs: the ATE of runs with enough coverage alone
    flatters a system that fails often."""
    if not len(finite(rows["ate_rmse_m"].to_numpy())):
        return []
    found = coverage_aware_ate(
        [number(v) for v in rows["ate_rmse_m"]], [number(v) for v in rows["coverage"]]
    )
    if found.survivors == found.runs:
        return []
    failed = _failed(rows)
    if not found.survivors:
        return [f"{failed}; their ATE is that of what they tracked"]
    ate = metric("ate_rmse_m")
    over_all = (
        "the median run failed"
        if found.median_m is None
        else f"median over all runs {ate.show(found.median_m)} {ate.shown_unit}"
    )
    return [
        f"{failed}; ATE of the others {ate.show(found.survivor_median_m)} {ate.shown_unit}, "
        f"{over_all}"
    ]


def _failed(rows: pd.DataFrame) -> str:
    """Returns how many runs rank as failed, by what they lack."""
    coverage, ate = (
        pd.to_numeric(rows[key], errors="coerce") for key in ("coverage", "ate_rmse_m")
    )
    below, without = coverage < LEAST_COVERAGE, ate.isna()
    counts = {
        f"tracked less than {LEAST_COVERAGE:.0%} of their frames": below,
        "without an ATE": ~below & without,
        "without a coverage": ~below & ~without & coverage.isna(),
    }
    parts = [
        f"{own.sum()} of {len(rows)} runs {words}" for words, own in counts.items() if own.any()
    ]
    return ", ".join(parts)


def _scale_note(rows: pd.DataFrame) -> list[str]:
    """Returns a note on a free scale, so that a Sim(3) error is not taken for a metric one."""
    free = rows[rows["ate_alignment"] == "sim3"]
    if not len(free):
        return []
    factor = float(np.median(finite(free["ate_scale"].to_numpy())))
    return [f"errors after Sim(3) alignment: the scale is free (median factor {factor:.3g})"]


def number(value: object) -> float | None:
    """Returns a float, or None for null."""
    return None if value is None or value != value else float(str(value))


def what_runs_show(cells: list[Cell]) -> str:
    """Returns which difference the runs of the smallest cell can show. Cells without a valid run
    do not count; empty if there is nothing to compare."""
    counts = [cell.valid for cell in cells if cell.valid]
    return power_hint(min(counts)) if len(counts) > 1 else ""
