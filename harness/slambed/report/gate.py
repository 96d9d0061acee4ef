# SPDX-License-Identifier: Apache-2.0
"""Did tonight get worse than the baseline? Significant and relevant, or nothing measured: fail."""

from dataclasses import dataclass, field
from math import comb
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from slambed.errors import SlambedError
from slambed.metrics.comparison import fisher, holm
from slambed.metrics.robust_accuracy import LEAST_COVERAGE, failure_ranked
from slambed.metrics.statistics import finite
from slambed.report.catalog import Metric, metric
from slambed.report.cells import number
from slambed.report.load import load
from slambed.report.tables import Table

Floats = NDArray[np.float64]

GATED = (
    "lost", "failed", "coverage", "ate_rmse_m", "rpe_trans_m", "track_ms_median", "track_ms_p95",
    "local_mapping_ms_mean", "mobile_cpu_percent_mean", "mobile_mem_mb_peak",
    "edge_mem_mb_peak", "bytes_up", "bytes_down", "update_delay_ms_median",
)  # fmt: skip
BASELINE_NIGHTS = 30
"""Older nights of a history are another machine or another program."""
FAILED = "failed"
"""Not a key of the summary: whether coverage is below the least that counts as a success."""
ALPHA = 0.05
"""Chance of any false alarm in a night, over all cells and metrics together (Holm)."""


@dataclass(frozen=True)
class Finding:
    """One comparison of tonight with the baseline."""

    cell: str
    metric: Metric
    baseline: float
    tonight: float
    runs: tuple[int, int]
    p_value: float
    relevant: bool
    alarm: bool


@dataclass
class GateResult:
    """`failures` has a line per reason to fail; `notes` what could not be judged."""

    findings: list[Finding] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """True only when something was measured and nothing got worse."""
        return not self.failures

    def table(self) -> Table:
        """The findings, worst first."""
        rows = [
            [
                f.cell, f.metric.heading, f.metric.show(f.baseline), f.metric.show(f.tonight),
                f"{f.runs[0]} / {f.runs[1]}", f"{f.p_value:.2g}",
                "WORSE" if f.alarm else ("relevant, not significant" if f.relevant else "fine"),
            ]
            for f in sorted(self.findings, key=lambda f: (not f.alarm, f.p_value))
        ]  # fmt: skip
        headings = ["cell", "metric", "baseline", "tonight", "runs", "p (Holm)", "verdict"]
        return Table("gate", "Tonight against the baseline", headings, rows, words=2)


def worsening_p(baseline: Floats, tonight: Floats, better: str) -> Floats:
    """One-sided rank test along the last axis: is tonight worse? Exact without ties.

    Leading axes are independent tests; failed runs are infinite.
    """
    alternative: Literal["less", "greater"] = "less" if better == "higher" else "greater"
    both = np.sort(np.concatenate([baseline, tonight], axis=-1), axis=-1)
    with np.errstate(invalid="ignore"):
        ties = bool(np.any(both[..., 1:] == both[..., :-1]))
    method: Literal["asymptotic", "exact"] = "asymptotic" if ties else "exact"
    result = stats.mannwhitneyu(tonight, baseline, alternative=alternative, axis=-1, method=method)
    # All values equal: no spread, nothing shown.
    return np.nan_to_num(np.asarray(result.pvalue, dtype=np.float64), nan=1.0)


def is_relevant(baseline: Floats, tonight: Floats, item: Metric) -> NDArray[np.bool_]:
    """Whether the median (share) worsened by more than the metric's minimum effect."""
    middle = np.mean if item.kind == "share" else np.median
    before = np.asarray(middle(baseline, axis=-1))
    after = np.asarray(middle(tonight, axis=-1))
    with np.errstate(invalid="ignore"):
        change = before - after if item.better == "higher" else after - before
    change = np.where(np.isfinite(before) & ~np.isfinite(after), np.inf, change)
    share = 0.0 if item.kind == "share" else item.relevant_share
    least = np.maximum(item.relevant_step, share * np.abs(before))
    relevant: NDArray[np.bool_] = np.nan_to_num(change, nan=0.0) > least
    return relevant


def judge(baseline: pd.DataFrame, tonight: pd.DataFrame, alpha: float = ALPHA) -> GateResult:
    """Compares runs (rows with the summary keys) cell by cell."""
    result = GateResult()
    if not len(tonight) or not tonight["valid"].eq(True).any():
        result.failures.append("nothing was measured tonight: there is no valid run")
    if not len(baseline) or not baseline["valid"].eq(True).any():
        result.failures.append("the baseline has no valid run: there is nothing to compare with")
    if result.failures:
        return result
    raw: list[tuple[str, Metric, Floats, Floats, float]] = []
    for cell, before in baseline.groupby("cell", sort=False):
        after = tonight[tonight["cell"] == cell]
        good, good_before = after[after["valid"].eq(True)], before[before["valid"].eq(True)]
        if not len(good_before):
            continue
        if not len(good):
            result.failures.append(f"{cell}: nothing measured tonight ({len(after)} runs, 0 valid)")
            continue
        _judge_validity(str(cell), before, after, alpha, result)
        for key in GATED:
            if key != FAILED and (key not in good or key not in good_before):
                continue
            item = metric(key)
            a, b = _values(good_before, key), _values(good, key)
            if len(a) and not len(b):
                result.failures.append(f"{cell}: {item.label} was not measured tonight")
            if len(a) and len(b):
                raw.append((str(cell), item, a, b, _p_value(a, b, item)))
    _decide(raw, alpha, result)
    return result


def _decide(
    raw: list[tuple[str, Metric, Floats, Floats, float]], alpha: float, result: GateResult
) -> None:
    if not raw:
        result.failures.append("no gated metric was measured in both")
        return
    adjusted = holm([entry[4] for entry in raw])
    blind: set[str] = set()
    for (cell, item, a, b, _), p in zip(raw, adjusted, strict=True):
        relevant = bool(is_relevant(a, b, item))
        alarm = relevant and float(p) <= alpha
        middle = np.mean if item.kind == "share" else np.median
        before, after = float(middle(a)), float(middle(b))
        counts = (len(a), len(b))
        result.findings.append(
            Finding(cell, item, before, after, counts, float(p), relevant, alarm)
        )
        if alarm:
            result.failures.append(
                f"{cell}: {item.label} {item.show(before)} -> {item.show(after)} {item.unit} "
                f"(p {p:.2g}, {counts[0]} / {counts[1]} runs)"
            )
        if 1 / comb(sum(counts), counts[0]) > alpha / len(raw):
            blind.add(f"{cell}: {counts[0]} and {counts[1]} runs can never raise an alarm among "
                      f"{len(raw)} tests; run more")  # fmt: skip
    result.notes += sorted(blind)


def _judge_validity(
    cell: str, before: pd.DataFrame, after: pd.DataFrame, alpha: float, result: GateResult
) -> None:
    """Invalid runs are left out of all other tests, so they are tested themselves."""
    bad_before = len(before) - int(before["valid"].eq(True).sum())
    bad_after = len(after) - int(after["valid"].eq(True).sum())
    p_value = fisher(bad_before, len(before), bad_after, len(after), "greater")
    if p_value <= alpha / 10 and bad_after / len(after) - bad_before / len(before) > 0.1:
        result.failures.append(
            f"{cell}: {bad_after} of {len(after)} runs not valid, before {bad_before} of "
            f"{len(before)} (p {p_value:.2g})"
        )


def _values(rows: pd.DataFrame, key: str) -> Floats:
    """Values of a metric; a run that failed has an infinitely bad ATE, not none."""
    if key == FAILED:
        covered = finite(rows["coverage"].to_numpy())
        return np.asarray(covered < LEAST_COVERAGE, dtype=np.float64)
    if key != "ate_rmse_m":
        return finite(rows[key].to_numpy())
    if not len(finite(rows[key].to_numpy())):
        return np.zeros(0)
    pairs = zip(rows[key], rows["coverage"], strict=True)
    return np.array([failure_ranked(number(ate), number(cover)) for ate, cover in pairs])


def _p_value(a: Floats, b: Floats, item: Metric) -> float:
    if item.kind == "share":
        return fisher(int((a > 0).sum()), len(a), int((b > 0).sum()), len(b), "greater")
    return float(worsening_p(a, b, item.better))


def read_runs(folder: Path, experiment: str | None = None) -> tuple[pd.DataFrame, list[str]]:
    """Runs of a results folder, of `<folder>/<experiment>`, or of a kept history (Parquet, CSV).

    Raises SlambedError when there is nothing of that name; an empty folder gives no rows.
    """
    if folder.is_file():
        table = pd.read_parquet(folder) if folder.suffix == ".parquet" else pd.read_csv(folder)
        if experiment is not None and "experiment" in table:
            table = table[table["experiment"] == experiment]
        if "passed" in table:
            table = table[table["passed"].eq(True)]
            nights = sorted(table["night_utc"].unique())[-BASELINE_NIGHTS:]
            table = table[table["night_utc"].isin(nights)]
        return table, []
    if experiment is not None and (folder / experiment).is_dir():
        folder = folder / experiment
    if (folder / "runs").is_dir():
        results = load(folder)
        return results.runs, results.problems
    if (folder / "summary.csv").is_file():
        return pd.read_csv(folder / "summary.csv"), []
    if not folder.is_dir():
        raise SlambedError(f"no results, {folder} is not there, give a results folder or a history")
    return pd.DataFrame(columns=["cell", "valid", *GATED]), [f"{folder}: no runs in it"]


def append_history(history: Path, runs: pd.DataFrame, night_utc: str, passed: bool) -> int:
    """Adds tonight's runs to a Parquet history; those of the same night and experiment are
    replaced. Nights that did not pass are kept too, but are no baseline. Returns its rows."""
    new = runs.assign(night_utc=night_utc, passed=passed)
    if history.exists():
        old = pd.read_parquet(history)
        same = (old["night_utc"] == night_utc) & old["experiment"].isin(new["experiment"].unique())
        old = old[~same]
        new = pd.concat([old.astype(object), new.astype(object)], ignore_index=True)
    history.parent.mkdir(parents=True, exist_ok=True)
    partial = history.with_suffix(".partial")
    _plain(new).to_parquet(partial, index=False)
    partial.rename(history)
    return len(new)


def _plain(table: pd.DataFrame) -> pd.DataFrame:
    """One type per column: Parquet refuses mixtures, which nulls and booleans become."""
    columns: dict[str, Any] = {}
    for name in table:
        values = table[name]
        kinds = {type(v) for v in values if v is not None and v == v}
        if kinds <= {bool, np.bool_}:
            columns[str(name)] = values.astype("boolean")
        elif kinds <= {int, float, np.int64, np.float64}:
            columns[str(name)] = pd.to_numeric(values, errors="coerce").astype("float64")
        else:
            columns[str(name)] = values.map(lambda v: None if v is None or v != v else str(v))
    return pd.DataFrame(columns)
