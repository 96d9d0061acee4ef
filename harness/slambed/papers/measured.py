# SPDX-License-Identifier: Apache-2.0
"""Our counterpart of a published number: one value per run in the paper's unit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from slambed.metrics.events import EventLog
from slambed.metrics.stages import delays
from slambed.metrics.tracking import tracking_of
from slambed.metrics.update_round import update_rounds
from slambed.papers.lookup import Found, Pool, find_reference, find_runs, matching
from slambed.papers.published import Paper, PaperMetric
from slambed.papers.reference_runs import reference_errors
from slambed.papers.verdicts.model import Floats, Mean, Share
from slambed.report.figures.stages import event_log

EXPOSURE = 0.05
"""Relative difference in played time that is allowed where a number grows with it."""
MEDIAN_DRAWS = 1000
MEDIAN_SEED = 20263


@dataclass(frozen=True)
class Measured:
    """Our values at some coordinates; without runs, `found` has the reason."""

    found: Found
    values: Floats
    """One per run, in the paper's unit; for a share 0 or 1."""
    repetitions: tuple[int, ...] = ()
    keys: tuple[tuple[str, str], ...] = ()
    """(experiment, run key) of every value."""
    is_share: bool = False
    median: bool = False

    @property
    def there(self) -> bool:
        return len(self.values) > 0

    @property
    def share(self) -> Share:
        """Returns the runs with a track loss, of all runs."""
        return Share(int((self.values > 0).sum()), len(self.values))

    @property
    def ours(self) -> Share | Floats:
        """Returns the share or the values, for tests of orderings."""
        return self.share if self.is_share else self.values

    @property
    def mean(self) -> Mean:
        """Returns the mean, or the median with a spread from its bootstrap."""
        if not self.median or len(self.values) < 2:
            return Mean.of(self.values)
        generator = np.random.default_rng(MEDIAN_SEED)
        size = (MEDIAN_DRAWS, len(self.values))
        drawn = np.median(self.values[generator.integers(0, len(self.values), size)], axis=1)
        spread = float(drawn.std(ddof=1)) * len(self.values) ** 0.5
        return Mean(float(np.median(self.values)), spread, len(self.values))


NOTHING: Floats = np.zeros(0)


def alike(cells: Sequence[Measured]) -> str:
    """Returns why our values at these coordinates cannot differ; empty if they can."""
    if not all(cell.there for cell in cells):
        return ""
    if all(cell.is_share for cell in cells):
        shares = {cell.share.value for cell in cells}
        words = {0.0: "no run of ours lost track", 1.0: "every run of ours lost track"}
        return words.get(shares.pop(), "") if len(shares) == 1 else ""
    first, *others = (np.sort(cell.values) for cell in cells)
    same = bool(others) and all(np.array_equal(first, other) for other in others)
    return "ours are the same, run by run" if same else ""


def measure(
    paper: Paper, pool: Pool, name: str, system: str | None, conditions: dict[str, Any]
) -> Measured:
    """Returns our values of a paper's metric at these coordinates."""
    if name not in paper.metrics:
        return Measured(Found(None, "no_metric", f"no number of ours for '{name}'"), NOTHING)
    found = find_runs(paper, pool.runs, system, conditions)
    measured = values_of(paper, pool, name, found, conditions)
    if measured.there or found.runs is None or found.stand_in:
        return measured
    # The paper's own sequence may be an excerpt, too short for this number; then substitutes count.
    others = pool.runs[~pool.runs["dataset"].isin(set(found.runs["dataset"]))]
    again = values_of(paper, pool, name, find_runs(paper, others, system, conditions), conditions)
    return again if again.there and again.found.stand_in else measured


def values_of(
    paper: Paper, pool: Pool, name: str, found: Found, conditions: dict[str, Any]
) -> Measured:
    """Returns our values of a mapped metric for runs already found."""
    metric, runs = paper.metrics[name], found.runs
    if runs is None:
        return Measured(found, NOTHING)
    if (odd := _exposure(paper, metric, runs, conditions)) and not found.stand_in:
        return Measured(replace(found, missing="too_few_runs", reason=odd), NOTHING)
    if metric.only_without_loss:
        runs = runs[runs["lost"].eq(False)]
        if not len(runs):
            all_lost = replace(found, missing="too_few_runs", reason="every run lost track")
            return Measured(all_lost, NOTHING)
    runs = matching(runs, metric.only)
    if not len(runs):
        reason = f"no run with {metric.only}"
        return Measured(replace(found, missing="no_metric", reason=reason), NOTHING)
    if metric.reference is None:
        values = _values(pool, runs, metric)
    else:
        same_sequence = pool.runs[pool.runs["dataset"].isin(set(runs["dataset"]))]
        against = find_reference(paper, same_sequence, metric.reference, conditions)
        if against.runs is None:
            return Measured(against, NOTHING)
        values = reference_errors(pool.results, runs, against.runs)
    known = values.notna()
    if not known.any():
        if played := _without_events(pool, runs, metric):
            return Measured(replace(found, runs=None, missing="no_events", reason=played), NOTHING)
        message = f"{metric.key} was not measured in {len(runs)} runs"
        return Measured(Found(None, "no_metric", message), NOTHING)
    runs, values = runs[known], values[known]
    scale = 1.0 if metric.statistic == "share" else metric.scale
    # Of stand-ins only one is used, so each of its runs counts.
    if paper.datasets[conditions["dataset"]].each_sequence_once and not found.stand_in:
        one_each = np.asarray(values.groupby(runs["dataset"]).mean(), dtype=np.float64)
        return Measured(found, one_each * scale, (), _keys(runs))
    return Measured(
        found,
        np.asarray(values, dtype=np.float64) * scale,
        tuple(int(r) for r in runs["repetition"]) if "repetition" in runs else (),
        _keys(runs),
        metric.statistic == "share",
        metric.statistic == "median",
    )


def _keys(runs: pd.DataFrame) -> tuple[tuple[str, str], ...]:
    folders = runs["experiment_folder"].astype(str)
    return tuple(zip(folders, runs["run_key"].astype(str), strict=True))


def _exposure(
    paper: Paper, metric: PaperMetric, runs: pd.DataFrame, conditions: dict[str, Any]
) -> str:
    """Returns why runs played too little or too much of the sequence for a share of runs with a
    loss; empty if they match the paper."""
    played = paper.datasets[conditions["dataset"]].played_s
    if not metric.needs_exposure or played is None or "wall_s" not in runs:
        return ""
    whole = pd.to_numeric(runs.loc[runs["lost"].eq(False), "wall_s"], errors="coerce").dropna()
    if not len(whole) or abs(float(whole.median()) / played - 1) <= EXPOSURE:
        return ""
    return f"{whole.median():.0f} s were played, {played:g} s by the paper"


def _values(pool: Pool, runs: pd.DataFrame, metric: PaperMetric) -> "pd.Series[float]":
    if source := _event_source(metric):
        part = metric.key.partition(".")[2]
        found = [
            _from_events(pool, str(folder), str(key), source, part)
            for folder, key in zip(runs["experiment_folder"], runs["run_key"], strict=True)
        ]
        return pd.Series(found, index=runs.index, dtype="float64")
    if metric.key not in runs:
        return pd.Series(np.nan, index=runs.index)
    values = pd.to_numeric(runs[metric.key], errors="coerce").astype("float64")
    for key in metric.plus:
        values = values + (pd.to_numeric(runs[key], errors="coerce") if key in runs else np.nan)
    return values


def _event_source(metric: PaperMetric) -> str:
    """Returns `delay` or `tracking` for a number computed from events, else an empty string."""
    source, _, part = metric.key.partition(".")
    return source if source in ("delay", "tracking") and part else ""


def _without_events(pool: Pool, runs: pd.DataFrame, metric: PaperMetric) -> str:
    """Returns what to do if no run has the events that this number needs, as with runs of `slambed
    results pack`."""
    if not (source := _event_source(metric)):
        return ""
    places = zip(runs["experiment_folder"].astype(str), runs["run_key"].astype(str), strict=True)
    if any(_events(pool, folder, key, source) is not None for folder, key in places):
        return ""
    names = sorted(set(runs["experiment_folder"].astype(str)))
    engine = str(runs["engine"].iloc[0])
    play = f"slambed run {names[0]} --engine {engine} --runs {len(runs)} --force '*'"
    return f"{len(runs)} runs are there, without events; {play} makes them"


def _from_events(pool: Pool, folder: str, key: str, source: str, part: str) -> float | None:
    place = (key, f"{source}.{part}")
    if place not in pool.from_events:
        log = _events(pool, folder, key, source)
        if source == "delay":
            for name, delay in (delays(log) if log is not None else {}).items():
                pool.from_events[key, f"delay.{name}"] = delay.mean_ms
        elif log is not None:
            value = getattr(tracking_of(log), part, None)
            pool.from_events[place] = None if value is None else float(value)
        pool.from_events.setdefault(place, None)
    return pool.from_events[place]


def _events(pool: Pool, folder: str, key: str, source: str) -> EventLog | None:
    """Returns the events of a run that such numbers need, None if they were not kept. Updates that
    report their own parts are enough for delays."""
    if source == "delay":
        updates = pool.results[folder].events(key, ("update_applied",))
        if updates is not None and update_rounds(updates):
            return updates
    return event_log(pool.results[folder], key)
