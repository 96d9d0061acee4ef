# SPDX-License-Identifier: Apache-2.0
"""Numbers per cell: estimates with intervals, groups in the data, and tests between systems."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from slambed.metrics.comparison import fisher, holm, mann_whitney, two_modes
from slambed.metrics.robust_accuracy import LEAST_COVERAGE, coverage_aware_ate
from slambed.metrics.statistics import Interval, bootstrap, finite, wilson
from slambed.report.catalog import COMPARED, MAIN, Metric, metric
from slambed.report.load import TEXT_KEYS, Results

MOST_FAULTS = 3
"""So many different words about the faults of a cell are told, the most frequent first."""


@dataclass(frozen=True)
class Cell:
    """All runs of one condition."""

    name: str
    label: str
    dataset: str
    profile: str
    runs: int
    valid: int
    faults: str
    """What went wrong on purpose in its runs, nothing when nothing did."""
    values: dict[str, Interval]
    """By metric key; a metric without any measured value is absent."""
    notes: list[str]


def metrics_to_show(results: Results) -> list[Metric]:
    """What the experiment asks for first, then the usual ones; only what was measured anywhere.

    Words are no metrics: cells have what is said about them.
    """
    report = results.spec.get("report")
    asked = report.get("metrics") if isinstance(report, dict) else None
    asked = [key for key in asked if isinstance(key, str)] if isinstance(asked, list) else []
    keys = dict.fromkeys([*("lost" if k == "track_losses" else k for k in asked), *asked, *MAIN])
    runs = results.valid
    numbers = [k for k in keys if k in runs and k not in TEXT_KEYS]
    return [metric(k) for k in numbers if len(finite(runs[k].to_numpy()))]


def cells_of(results: Results, metrics: list[Metric]) -> list[Cell]:
    """Every cell in order, with the estimates of its valid runs."""
    groups = {name: rows for name, rows in results.runs.groupby("cell", sort=False)}
    return [_cell(name, groups[name], metrics) for name in results.cells()]


def _cell(name: str, rows: pd.DataFrame, metrics: list[Metric]) -> Cell:
    good = rows[rows["valid"].eq(True)]
    first = rows.iloc[0]
    values: dict[str, Interval] = {}
    notes: list[str] = []
    for item in metrics:
        if (found := estimate(good, item)) is not None:
            values[item.key] = found
        notes += _groups_note(good, item)
    reasons = rows.loc[~rows["valid"].eq(True), "invalid_reason"].astype(str).value_counts()
    notes += [f"{count} not valid: {reason}" for reason, count in reasons.items()]
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
    )


def _faults(rows: pd.DataFrame) -> str:
    """Each different one once: live runs of a cell may differ by some tenths of a second."""
    found = list(rows["faults"].dropna().astype(str).value_counts().index)
    more = len(found) - MOST_FAULTS
    return "; ".join(found[:MOST_FAULTS]) + (f"; {more} more" if more > 0 else "")


def text(value: object) -> str:
    """A name, or nothing for null."""
    return "" if value is None or value != value else str(value)


def estimate(rows: pd.DataFrame, item: Metric) -> Interval | None:
    """Share with Wilson's interval, or median with a bootstrap interval; None when not measured."""
    if item.key not in rows:
        return None
    values = finite(rows[item.key].to_numpy())
    if len(values) == 0:
        return None
    if item.kind == "share":
        return wilson(int((values > 0).sum()), len(values))
    return bootstrap(values)


def _groups_note(rows: pd.DataFrame, item: Metric) -> list[str]:
    """One median would hide two groups of runs: say so."""
    if item.kind == "share" or item.key not in rows:
        return []
    modes = two_modes(rows[item.key].to_numpy())
    if modes is None:
        return []
    return [
        f"{item.label}: two groups, {modes.low_count} runs near {item.show(modes.low_median)} and "
        f"{modes.high_count} near {item.show(modes.high_median)} {item.unit}".rstrip()
    ]


def _coverage_note(rows: pd.DataFrame) -> list[str]:
    """ATE of survivors flatters a system that fails often: give the median over all runs too."""
    if not len(finite(rows["ate_rmse_m"].to_numpy())):
        return []
    found = coverage_aware_ate(
        [number(v) for v in rows["ate_rmse_m"]], [number(v) for v in rows["coverage"]]
    )
    if found.survivors == found.runs:
        return []
    ate = metric("ate_rmse_m")
    over_all = (
        "the median run failed"
        if found.median_m is None
        else (f"median over all runs {ate.show(found.median_m)} {ate.unit}")
    )
    return [
        f"{found.runs - found.survivors} of {found.runs} runs tracked less than "
        f"{LEAST_COVERAGE:.0%} of their frames; ATE of the others "
        f"{ate.show(found.survivor_median_m)} {ate.unit}, {over_all}"
    ]


def _scale_note(rows: pd.DataFrame) -> list[str]:
    """A path that was judged up to its scale must not pass for one in metres."""
    free = rows[rows["ate_alignment"] == "sim3"]
    if not len(free):
        return []
    factor = float(np.median(finite(free["ate_scale"].to_numpy())))
    return [f"errors after Sim(3) alignment: the scale is free (median factor {factor:.3g})"]


def number(value: object) -> float | None:
    """A float, None for null."""
    return None if value is None or value != value else float(str(value))


@dataclass(frozen=True)
class Difference:
    """One metric of one system against the baseline system, under equal conditions."""

    dataset: str
    profile: str
    metric: Metric
    baseline: str
    other: str
    baseline_value: float
    other_value: float
    effect: str
    p_value: float
    """Adjusted for all comparisons of the experiment (Holm)."""

    @property
    def verdict(self) -> str:
        """In words; equality is never claimed."""
        if self.p_value > 0.05:
            return "no difference shown"
        rises = self.other_value > self.baseline_value
        if self.metric.better == "neither" or self.other_value == self.baseline_value:
            return "different"
        return "better" if rises == (self.metric.better == "higher") else "worse"


def differences(results: Results, baseline: str | None = None) -> list[Difference]:
    """Every system against the first one (or `baseline`) with the same dataset and profile."""
    runs = results.valid
    if not len(runs):
        return []
    labels = list(dict.fromkeys(runs["label"]))
    first = baseline if baseline is not None and baseline in labels else str(labels[0])
    found: list[Difference] = []
    for (dataset, profile), group in runs.groupby(["dataset", "profile"], sort=False, dropna=False):
        base = group[group["label"] == first]
        for label in labels:
            other = group[group["label"] == label]
            if label == first or not len(base) or not len(other):
                continue
            for key in COMPARED:
                test = _test(base, other, metric(key))
                if test is None:
                    continue
                a, b, effect, p_value = test
                found.append(
                    Difference(
                        text(dataset), text(profile) or "no link", metric(key),
                        first, label, a, b, effect, p_value,
                    )
                )  # fmt: skip
    if not found:
        return []
    adjusted = holm([item.p_value for item in found])
    return [replace(d, p_value=float(p)) for d, p in zip(found, adjusted, strict=True)]


def _test(
    base: pd.DataFrame, other: pd.DataFrame, item: Metric
) -> tuple[float, float, str, float] | None:
    if item.key not in base or item.key not in other:
        return None
    a, b = finite(base[item.key].to_numpy()), finite(other[item.key].to_numpy())
    if len(a) < 2 or len(b) < 2:
        return None
    if item.kind == "share":
        bad_a, bad_b = int((a > 0).sum()), int((b > 0).sum())
        share_a, share_b = bad_a / len(a), bad_b / len(b)
        points = f"{100 * (share_b - share_a):+.0f} points"
        return share_a, share_b, points, fisher(bad_a, len(a), bad_b, len(b))
    test = mann_whitney(a, b)
    p_value = 1.0 if np.isnan(test.p_value) else test.p_value
    effect = f"{test.cliffs_delta:+.2f} ({test.size})"
    return float(np.median(a)), float(np.median(b)), effect, p_value
