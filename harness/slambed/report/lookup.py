# SPDX-License-Identifier: Apache-2.0
"""Finds the runs of ours that a published number is about, or says why there are none."""

from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
import pandas as pd

from slambed.errors import SlambedError
from slambed.metrics.stages import delays
from slambed.metrics.statistics import Interval, bootstrap, finite, wilson
from slambed.metrics.tracking import tracking_of
from slambed.report.figures.stages import event_log
from slambed.report.load import Results
from slambed.report.papers import Match, Paper, PaperMetric

RUNS_WITH_EVENTS = 30
"""Event logs read per published number; more would not change a mean visibly."""
LIVE = "live"
VIRTUAL = "virtual"


@dataclass
class Pool:
    """The valid runs of several experiments in one table; `experiment_folder` finds their files."""

    runs: pd.DataFrame
    results: dict[str, Results]

    def of_engine(self, engine: str) -> "Pool":
        """Only live or only virtual runs: the two are never mixed in one number."""
        virtual = self.runs["engine"].astype(str).eq(VIRTUAL)
        return Pool(self.runs[virtual if engine == VIRTUAL else ~virtual], self.results)

    def about(self, paper: Paper, source: str) -> "Pool":
        """Only runs of experiments that say they reproduce this table or claim: others, such as
        sensitivity studies, differ from it in ways its coordinates do not name."""
        own = [r for r in self.results.values() if source in paper.sources(reproduces(r))]
        return pool_of(own)

    def engines(self) -> list[str]:
        """`live`, `virtual`, both or none."""
        virtual = self.runs["engine"].astype(str).eq(VIRTUAL)
        found = [LIVE] if (~virtual).any() else []
        return [*found, VIRTUAL] if virtual.any() else found


def reproduces(results: Results) -> set[str]:
    """What an experiment says it reproduces: ids of papers, tables, figures and claims."""
    return {str(name) for name in results.spec.get("reproduces") or []}


def pool_of(experiments: list[Results]) -> Pool:
    """Valid runs of all experiments; a run that several of them share counts once."""
    parts = [r.valid.assign(experiment_folder=r.name) for r in experiments if len(r.valid)]
    if not parts:
        columns = ["engine", "system", "variant", "dataset", "profile", "run_key"]
        return Pool(pd.DataFrame(columns=columns), {})
    runs = pd.concat(parts, ignore_index=True).drop_duplicates("run_key", ignore_index=True)
    return Pool(runs, {r.name: r for r in experiments})


@dataclass(frozen=True)
class Found:
    """The runs at some coordinates, or (`reason`) why there are none."""

    runs: pd.DataFrame | None
    reason: str = ""
    stand_in: bool = False


def find_runs(paper: Paper, pool: Pool, coordinates: dict[str, Any]) -> Found:
    """Runs with this system, dataset and conditions in the paper's words."""
    left = dict(coordinates)
    left.pop("metric", None)
    system = left.pop("system", None)
    if system is None:
        return Found(None, "the paper names no system here")
    if system not in paper.systems:
        return Found(None, f"system '{system}' has no counterpart of ours")
    runs = matching(pool.runs, paper.systems[system].match)
    if not len(runs):
        return Found(None, f"{paper.systems[system].label}: no valid run")
    dataset = left.pop("dataset", None)
    if dataset not in paper.datasets:
        return Found(None, "the paper does not name the dataset" if dataset is None else
                     f"dataset '{dataset}' has no counterpart of ours")  # fmt: skip
    where = paper.datasets[dataset]
    exact = matching(runs, {"dataset": where.match})
    stand_in = not len(exact)
    runs = exact if len(exact) else matching(runs, {"dataset": where.stand_in})
    if not len(runs):
        return Found(
            None, f"{where.label}: no valid run" + (f" ({where.note})" if where.note else "")
        )
    for name, value in left.items():
        found = _condition(paper, runs, str(system), name, value)
        if isinstance(found, str):
            return Found(None, found)
        runs = found
    return Found(runs, stand_in=stand_in)


def matching(runs: pd.DataFrame, match: Match) -> pd.DataFrame:
    """Rows whose columns fit the patterns; a column that is not there fits nothing."""
    for column, patterns in match.items():
        wanted = [patterns] if isinstance(patterns, str) else patterns
        if column not in runs:
            return runs.iloc[:0]
        text = runs[column].astype(str)
        fits = text.map({v: any(fnmatchcase(v, p) for p in wanted) for v in text.unique()})
        runs = runs[fits.astype(bool)]
    return runs


def _condition(
    paper: Paper, runs: pd.DataFrame, system: str, name: str, value: Any
) -> pd.DataFrame | str:
    rule = paper.conditions.get(name)
    if rule == "ignore":
        return runs
    if not isinstance(rule, dict):
        return f"condition '{name}' cannot be expressed in our runs"
    if "column" in rule:
        only = rule.get("systems")
        if only and not any(fnmatchcase(system, pattern) for pattern in only):
            return runs
        column = str(rule["column"])
        if column not in runs:
            return f"no run with {column}"
        chosen = runs[pd.to_numeric(runs[column], errors="coerce").eq(value)]
        return chosen if len(chosen) else f"no run with {column} = {value}"
    match = rule.get(value, rule.get("*"))
    if match is None:
        return f"{name} = {value} cannot be expressed in our runs"
    # Without an edge there is no link: the profile does not matter to such a system.
    if runs["link_backend"].isna().all() and set(match) == {"profile"}:
        return runs
    chosen = matching(runs, match)
    return chosen if len(chosen) else f"no run with {name} = {value}"


def our_value(pool: Pool, runs: pd.DataFrame, metric: PaperMetric) -> Interval | str:
    """Estimate with interval in the paper's unit, or why there is none."""
    if metric.only_without_loss:
        runs = runs[runs["lost"].eq(False)]
        if not len(runs):
            return "every run lost track"
    values = _values(pool, runs, metric)
    if not len(values):
        return f"{metric.key} was not measured in {len(runs)} runs"
    if metric.statistic == "share":
        return wilson(int((values > 0).sum()), len(values)).scaled(metric.scale)
    try:
        return bootstrap(values, metric.statistic).scaled(metric.scale)
    except SlambedError as error:
        return str(error)


def _values(pool: Pool, runs: pd.DataFrame, metric: PaperMetric) -> Any:
    source, _, part = metric.key.partition(".")
    if source in ("delay", "tracking") and part:
        return np.array(_from_events(pool, runs, source, part))
    if metric.key not in runs:
        return np.zeros(0)
    values = pd.to_numeric(runs[metric.key], errors="coerce")
    if metric.per_second:
        values = values / pd.to_numeric(runs["wall_s"], errors="coerce")
    return finite(values.to_numpy())


def _from_events(pool: Pool, runs: pd.DataFrame, source: str, part: str) -> list[float]:
    found: list[float] = []
    for _, row in runs.head(RUNS_WITH_EVENTS).iterrows():
        log = event_log(pool.results[str(row["experiment_folder"])], str(row["run_key"]))
        if log is None:
            continue
        if source == "delay":
            delay = delays(log).get(part)
            value = delay.mean_ms if delay is not None else None
        else:
            value = getattr(tracking_of(log), part, None)
        if value is not None:
            found.append(float(value))
    return found
