# SPDX-License-Identifier: Apache-2.0
"""The regression gate: fails if tonight is significantly and relevantly worse than the baseline, or
if nothing was measured."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from slambed.errors import SlambedError
from slambed.files.atomic import replacing
from slambed.metrics.catalog import keys_for, metric
from slambed.metrics.comparison import fisher, holm
from slambed.metrics.metric import Metric, Use
from slambed.older_names import SUMMARY, summary_of_today
from slambed.regression.nights import Test, comparable, values_of_nights
from slambed.report.load import load
from slambed.report.metrics_versions import own_metrics_in
from slambed.report.tables import Table

Floats = NDArray[np.float64]

BASELINE_NIGHTS = 30
"""Most recent nights used; older ones may be from another machine or program."""
HISTORY_COLUMNS = ("night_utc", "experiment", "cell", "valid")
"""Every history has these."""
ALPHA = 0.05
"""Chance of any false alarm in a night, over all cells and metrics (Holm)."""

AFTER_A_CHANGE = (
    "; after a change of the metrics or of the experiment, accept one night with --first-night"
)


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
class RegressionResult:
    """`failures` has a line per reason to fail; `notes` has what could not be judged."""

    findings: list[Finding] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Returns True only if something was measured and nothing got worse."""
        return not self.failures

    def table(self) -> Table:
        """Returns the findings, worst first."""
        rows = [
            [
                f.cell,
                f.metric.heading,
                f.metric.show(f.baseline),
                f.metric.show(f.tonight),
                f"{f.runs[0]} / {f.runs[1]}",
                f"{f.p_value:.2g}",
                "WORSE" if f.alarm else ("relevant, not significant" if f.relevant else "fine"),
            ]
            for f in sorted(self.findings, key=lambda f: (not f.alarm, f.p_value))
        ]
        headings = ["cell", "metric", "baseline", "tonight", "runs", "p (Holm)", "verdict"]
        return Table("gate", "Tonight against the baseline", headings, rows, words=2)


def is_relevant(baseline: Floats, tonight: Floats, item: Metric) -> NDArray[np.bool_]:
    """Returns whether the median (or share) worsened by more than the metric's minimum effect,
    along the last axis."""
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


def judge(
    baseline: pd.DataFrame,
    tonight: pd.DataFrame,
    alpha: float = ALPHA,
    metrics: Sequence[str] = (),
) -> RegressionResult:
    """Compares runs (rows with the summary keys) cell by cell, for `metrics` or all gated
    metrics."""
    result = RegressionResult()
    if not len(tonight) or not tonight["valid"].eq(True).any():
        result.failures.append("nothing was measured tonight: there is no valid run")
    elif len(baseline):
        baseline, line = comparable(_of_today(baseline, tonight), tonight)
        result.notes += [line] if line else []
    if not len(baseline) or not baseline["valid"].eq(True).any():
        result.failures.append(
            f"the baseline has no valid run: there is nothing to compare with{AFTER_A_CHANGE}"
        )
    if result.failures:
        return result
    own = own_metrics_in(tonight)
    gated = metrics or keys_for(Use.GATED, own)
    tests: list[Test] = []
    cells = baseline.loc[baseline["valid"].eq(True), "cell"].nunique()
    for cell, before in baseline.groupby("cell", sort=False):
        after = tonight[tonight["cell"] == cell]
        good, good_before = after[after["valid"].eq(True)], before[before["valid"].eq(True)]
        if not len(good_before):
            continue
        if not len(good):
            result.failures.append(
                f"{cell}: nothing measured tonight ({len(after)} runs, none valid)"
                + ("" if len(after) else AFTER_A_CHANGE)
            )
            continue
        _judge_validity(str(cell), before, after, alpha / cells, result)
        newest = _newest_night(good_before)
        for key in gated:
            item = metric(key, own)
            a, b, paired = values_of_nights(good_before, good, item)
            if len(a) and not len(b) and item.key in newest and newest[item.key].notna().any():
                result.failures.append(
                    f"{cell}: {item.name} was not measured tonight{AFTER_A_CHANGE}"
                )
            if len(b) and not len(a):
                result.notes.append(f"{cell}: {item.name} is new tonight, without a baseline")
            if len(a) and len(b):
                tests.append(Test(str(cell), item, a, b, paired))
    _new_cells(baseline, tonight, result)
    _decide(tests, alpha, result)
    return result


def _newest_night(baseline: pd.DataFrame) -> pd.DataFrame:
    """Returns the runs of the newest night; all of a baseline without nights."""
    if "night_utc" not in baseline:
        return baseline
    return baseline[baseline["night_utc"].eq(baseline["night_utc"].max())]


def _of_today(baseline: pd.DataFrame, tonight: pd.DataFrame) -> pd.DataFrame:
    """Returns the baseline without cells that neither its newest night nor tonight has: those were
    taken out of the experiment before, and do not miss."""
    cells = {*_newest_night(baseline)["cell"], *tonight["cell"]}
    return baseline[baseline["cell"].isin(cells)]


def _new_cells(baseline: pd.DataFrame, tonight: pd.DataFrame, result: RegressionResult) -> None:
    """Notes each cell without a baseline; it fails only if it has no valid run."""
    judged = set(baseline.loc[baseline["valid"].eq(True), "cell"])
    for cell, rows in tonight.groupby("cell", sort=False):
        if cell in judged:
            continue
        good = int(rows["valid"].eq(True).sum())
        count = f"{len(rows)} runs, {good} valid"
        line = f"{cell}: new tonight, nothing to compare with ({count})"
        (result.notes if good else result.failures).append(line)


def _decide(tests: list[Test], alpha: float, result: RegressionResult) -> None:
    if not tests:
        result.failures.append("no gated metric was measured in both")
        return
    adjusted = holm([test.p_value() for test in tests])
    blind: dict[str, list[Test]] = {}
    for test, p in zip(tests, adjusted, strict=True):
        item, counts = test.metric, (len(test.baseline), len(test.tonight))
        relevant = bool(is_relevant(test.baseline, test.tonight, item))
        alarm = relevant and float(p) <= alpha
        middle = np.mean if item.kind == "share" else np.median
        before, after = float(middle(test.baseline)), float(middle(test.tonight))
        result.findings.append(
            Finding(test.cell, item, before, after, counts, float(p), relevant, alarm)
        )
        if alarm:
            result.failures.append(
                f"{test.cell}: {item.name} {item.show(before)} -> {item.show(after)} "
                f"{item.shown_unit} (p {p:.2g}, {counts[0]} / {counts[1]} runs)"
            )
        if test.least_p() > alpha / len(tests):
            blind.setdefault(test.cell, []).append(test)
    for cell, missed in sorted(blind.items()):
        names = ", ".join(dict.fromkeys(test.metric.name for test in missed))
        counts = (len(missed[0].baseline), len(missed[0].tonight))
        needed = max(test.runs_needed(alpha / len(tests)) for test in missed)
        result.notes.append(
            f"{cell}: {counts[0]} and {counts[1]} runs can never raise an alarm about {names} "
            f"among {len(tests)} tests; from {needed} runs a night on they can"
        )


def _judge_validity(
    cell: str, before: pd.DataFrame, after: pd.DataFrame, alpha: float, result: RegressionResult
) -> None:
    """Tests the share of invalid runs, because all other tests leave these out. `alpha` is the
    cell's part of the chance of a false alarm."""
    bad_before = len(before) - int(before["valid"].eq(True).sum())
    bad_after = len(after) - int(after["valid"].eq(True).sum())
    p_value = fisher(bad_before, len(before), bad_after, len(after), "greater")
    if p_value <= alpha / 10 and bad_after / len(after) - bad_before / len(before) > 0.1:
        result.failures.append(
            f"{cell}: {bad_after} of {len(after)} runs invalid, before {bad_before} of "
            f"{len(before)} (p {p_value:.2g})"
        )


def read_runs(folder: Path, experiment: str | None = None) -> tuple[pd.DataFrame, list[str]]:
    """Reads the runs of `<folder>/<experiment>`, of the folder of one experiment, or of a history
    (Parquet, CSV).

    Raises SlambedError if there is nothing of that name; a folder without runs of the experiment
    gives no rows, and says so.
    """
    if folder.is_file():
        table = stored_table(folder)
        if experiment is not None and "experiment" in table:
            table = table[table["experiment"] == experiment]
        if "passed" in table and "night_utc" in table:
            table = table[table["passed"].eq(True)]
            nights = sorted(table["night_utc"].unique())[-BASELINE_NIGHTS:]
            table = table[table["night_utc"].isin(nights)]
        return table, []
    if experiment is not None and (folder / experiment).is_dir():
        folder = folder / experiment
    # The `runs` of a results folder are those of all experiments.
    of_one = experiment is None or (folder / "experiment.json").is_file()
    if of_one and (folder / "runs").is_dir():
        results = load(folder)
        return results.runs, results.problems
    if (folder / "summary.csv").is_file():
        return stored_table(folder / "summary.csv"), []
    if not folder.is_dir():
        raise SlambedError(f"no results, {folder} is not there, give a results folder or a history")
    whose = f" of {experiment}" if experiment is not None else ""
    return pd.DataFrame(columns=["cell", "valid", *keys_for(Use.GATED)]), [
        f"{folder}: no runs{whose} in it"
    ]


def stored_table(path: Path, needed: Collection[str] = ("cell", "valid")) -> pd.DataFrame:
    """Returns the summaries in a file (Parquet, CSV) with today's column names. Raises SlambedError
    for a file without the needed columns."""
    try:
        # A version such as 9 is a text in Parquet and in today's runs.
        texts = {"metrics_version": str, "run_key": str}
        parquet = path.suffix == ".parquet"
        table = pd.read_parquet(path) if parquet else pd.read_csv(path, dtype=texts)
        table = table_of_today(table)
    except (OSError, ValueError) as broken:
        reason = str(broken).partition("\n")[0]
        raise SlambedError(f"{path} is no history of the regression gate: {reason}") from None
    if missing := set(needed) - set(table):
        raise SlambedError(
            f"{path} is no history of the regression gate, it has no column {min(missing)}"
        )
    return table


def table_of_today(table: pd.DataFrame) -> pd.DataFrame:
    """Returns summaries as rows with today's column names."""
    if "not_completed" in table or not len(table):
        return table.rename(columns=SUMMARY)
    rows = ({str(key): x for key, x in row.items()} for row in table.to_dict("records"))
    return pd.DataFrame([summary_of_today(row) for row in rows])


def append_history(
    history: Path, runs: pd.DataFrame, night_utc: str, passed: bool, commit: str = ""
) -> int:
    """Adds tonight's runs to a Parquet history and replaces those of the same night and experiment.
    Nights that failed are stored too, but are no baseline. Returns the number of rows."""
    new = runs.assign(night_utc=night_utc, passed=passed, commit=commit)
    if history.exists():
        old = stored_table(history, HISTORY_COLUMNS)
        same = (old["night_utc"] == night_utc) & old["experiment"].isin(new["experiment"].unique())
        old = old[~same]
        new = pd.concat([old.astype(object), new.astype(object)], ignore_index=True)
    history.parent.mkdir(parents=True, exist_ok=True)
    with replacing(history) as out:
        _plain(new).to_parquet(out, index=False)
    return len(new)


def _plain(table: pd.DataFrame) -> pd.DataFrame:
    """Converts each column to one type, because Parquet rejects the mixtures that nulls and
    booleans cause. A column without any value stays without a type."""
    columns: dict[str, Any] = {}
    for name in table:
        values = table[name]
        kinds = {type(v) for v in values[values.notna()]}
        if not kinds:
            columns[str(name)] = values.astype(object)
        elif kinds <= {bool, np.bool_}:
            columns[str(name)] = values.astype("boolean")
        elif kinds <= {int, float, np.int64, np.float64}:
            columns[str(name)] = pd.to_numeric(values, errors="coerce").astype("float64")
        else:
            columns[str(name)] = values.astype(object).map(str, na_action="ignore")
    return pd.DataFrame(columns)
