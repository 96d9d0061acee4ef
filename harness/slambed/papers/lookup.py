# SPDX-License-Identifier: Apache-2.0
"""Finds our runs for a published number, or the reason why there are none."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any, Literal

import pandas as pd

from slambed.papers.published import Match, Paper, PaperDataset
from slambed.report.load import Results

LIVE = "live"
VIRTUAL = "virtual"
ENGINES = (VIRTUAL, LIVE)

Missing = Literal["no_system", "no_data", "no_metric", "too_few_runs", "no_events"]
"""Reasons why we have no number to compare."""
MISSING_WORDS: dict[Missing, str] = {
    "no_system": "no system", "no_data": "no data", "no_metric": "no metric",
    "too_few_runs": "too few runs", "no_events": "run, events not kept",
}  # fmt: skip
POOL = "pool"
"""Key of a condition's value whose number is a mean over several values of a column."""
LEFT_OPEN = ("dataset", "variant", "profile", "device_mobile", "device_edge")
"""Columns in which the runs of one number must not differ, like every `params.*`."""


@dataclass
class Pool:
    """The valid runs of several experiments; column `experiment_folder` finds their files."""

    runs: pd.DataFrame
    results: dict[str, Results]
    engine: str = ""
    """The only kind of engine in it; empty for all."""
    from_events: dict[tuple[str, str], float | None] = field(default_factory=dict)
    """Cache of values from event logs, which are large, by run key and quantity."""
    narrowed: dict[str, "Pool"] = field(default_factory=dict)
    """Cache of `about`, by source."""

    def of_engine(self, engine: str) -> "Pool":
        """Returns only the live or only the virtual runs; one number never mixes them."""
        if not engine:
            return self
        virtual = self.runs["engine"].astype(str).eq(VIRTUAL)
        runs = self.runs[virtual if engine == VIRTUAL else ~virtual]
        return Pool(runs, self.results, engine, self.from_events)

    def about(self, paper: Paper, source: str) -> "Pool":
        """Returns only runs of experiments that reproduce this table, figure or claim. Others, such
        as sensitivity studies, differ in ways that its coordinates do not name."""
        if source not in self.narrowed:
            own = [r for r in self.results.values() if source in paper.sources(reproduces(r))]
            self.narrowed[source] = pool_of(own).of_engine(self.engine)
            self.narrowed[source].from_events = self.from_events
        return self.narrowed[source]

    def of_paper(self, paper: Paper) -> "Pool":
        """Returns only the runs of experiments that reproduce something of this paper."""
        own = [r for r in self.results.values() if paper.sources(reproduces(r))]
        return pool_of(own)

    def engines(self) -> list[str]:
        """Returns `virtual`, `live`, both or neither."""
        virtual = self.runs["engine"].astype(str).eq(VIRTUAL)
        found = [VIRTUAL] if virtual.any() else []
        return [*found, LIVE] if (~virtual).any() else found


def reproduces(results: Results) -> set[str]:
    """Returns what an experiment reproduces: ids of papers, tables, figures and claims."""
    return {str(name) for name in results.spec.get("reproduces") or []}


def pool_of(experiments: list[Results]) -> Pool:
    """Pools the valid runs of all experiments; a run that several share counts once."""
    parts = [
        r.valid_runs.assign(experiment_folder=r.name) for r in experiments if len(r.valid_runs)
    ]
    if not parts:
        columns = ["engine", "system", "variant", "dataset", "profile", "run_key"]
        return Pool(pd.DataFrame(columns=columns), {})
    runs = pd.concat(parts, ignore_index=True).drop_duplicates("run_key", ignore_index=True)
    return Pool(runs, {r.name: r for r in experiments})


@dataclass(frozen=True)
class Found:
    """The runs at some coordinates, or the reason why there are none (`missing`, `reason`)."""

    runs: pd.DataFrame | None
    missing: Missing | None = None
    reason: str = ""
    dataset: str = ""
    """Our name for the sequence."""
    stand_in: bool = False


def find_runs(
    paper: Paper, runs: pd.DataFrame, system: str | None, conditions: Mapping[str, Any]
) -> Found:
    """Finds the runs of this system, dataset and conditions, which are given in the paper's
    terms."""
    if system is None:
        return Found(None, "no_system", "the paper names no system here")
    if system not in paper.systems:
        return Found(None, "no_system", f"system '{system}' has no counterpart of ours")
    label, not_built = paper.systems[system].label, paper.systems[system].not_built
    if not_built is not None:
        return Found(None, "no_system", f"{label}: {not_built}")
    own = matching(runs, paper.systems[system].match)
    if not len(own):
        return Found(None, "too_few_runs", f"{label}: no valid run yet")
    left = dict(conditions)
    name = left.pop("dataset", None)
    if name not in paper.datasets:
        message = "the paper names no dataset here" if name is None else f"no data for '{name}'"
        return Found(None, "no_data", message)
    where = paper.datasets[name]
    first = None
    for dataset, chosen, stand_in in _sequences(where, own):
        for condition, value in left.items():
            narrowed = _condition(paper, chosen, system, condition, value)
            if isinstance(narrowed, str):
                first = first or Found(None, "too_few_runs", f"{label}: {narrowed}")
                break
            chosen = narrowed
        else:
            over = pooled_columns(paper, conditions)
            if open_columns := left_open(chosen, where.each_sequence_once, over):
                message = f"runs differ in {open_columns}, which the paper's numbers leave open"
                return Found(None, "no_metric", message)
            return Found(chosen, dataset=dataset, stand_in=stand_in)
    note = f" ({where.note})" if where.note else ""
    return first or Found(None, "no_data", f"{where.label}: no valid run yet{note}")


def find_reference(
    paper: Paper, runs: pd.DataFrame, system: str, conditions: Mapping[str, Any]
) -> Found:
    """Finds the runs of a reference system for a number with these conditions. A condition that the
    reference does not have, such as a parameter of the other system, does not apply to it."""
    known = paper.systems.get(system)
    own = matching(runs, known.match) if known is not None else runs
    shared = {
        name: value
        for name, value in conditions.items()
        if name == "dataset" or _applies(paper, own, name, value)
    }
    return find_runs(paper, runs, system, shared)


def _applies(paper: Paper, runs: pd.DataFrame, name: str, value: Any) -> bool:
    rule = paper.conditions.get(name)
    if not isinstance(rule, dict):
        return False
    columns = [str(rule["column"])] if "column" in rule else rule.get(value, rule.get("*")) or []
    return all(column in runs and runs[column].notna().any() for column in columns)


def _sequences(where: PaperDataset, runs: pd.DataFrame) -> list[tuple[str, pd.DataFrame, bool]]:
    """Returns the sequence itself, then each of its stand-ins, best first."""
    exact = matching(runs, {"dataset": where.match})
    found = [(", ".join(sorted(set(exact["dataset"]))), exact, False)] if len(exact) else []
    for pattern in where.stand_in:
        fits = matching(runs, {"dataset": pattern})
        found += [(str(name), part, True) for name, part in fits.groupby("dataset", sort=True)]
    return found


def pooled_columns(paper: Paper, conditions: Mapping[str, Any]) -> set[str]:
    """Returns the columns over which a number is a mean, because one of its conditions says so."""
    rules = (paper.conditions.get(name) for name in conditions)
    values = zip(rules, conditions.values(), strict=True)
    found = (rule.get(value) for rule, value in values if isinstance(rule, dict))
    return {column for match in found if isinstance(match, dict) for column in match.get(POOL, {})}


def left_open(
    runs: pd.DataFrame, several_sequences: bool = False, pooled: Collection[str] = ()
) -> str:
    """Names the columns that differ between runs that one number would pool, except those over
    which it is a mean; empty if none does."""
    if not len(runs):
        return ""
    columns = [c for c in runs if c in LEFT_OPEN or str(c).startswith("params.")]
    columns = [c for c in columns if c not in pooled]
    columns = [c for c in columns if c != "dataset" or not several_sequences]
    if "link_backend" in runs and runs["link_backend"].isna().all():
        columns = [c for c in columns if c not in ("profile", "device_edge")]
    varying = []
    for column in columns:
        values = sorted(set(runs[column].dropna().astype(str)))
        if len(values) > 1:
            varying.append(
                f"{column} ({', '.join(values[:3])}{', ...' if len(values) > 3 else ''})"
            )
    return " and ".join(varying)


def matching(runs: pd.DataFrame, match: Match) -> pd.DataFrame:
    """Returns the rows whose columns match the patterns; a missing column matches nothing."""
    for column, patterns in match.items():
        wanted = [patterns] if isinstance(patterns, str) else patterns
        if column not in runs:
            return runs.iloc[:0]
        text = runs[column].map(str)
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
    if POOL in match:
        return _pooled(runs, match[POOL], name, value)
    # Without an edge there is no link, so the profile does not matter to such a system.
    if runs["link_backend"].isna().all() and set(match) == {"profile"}:
        return runs
    chosen = matching(runs, match)
    return chosen if len(chosen) else f"no run with {name} = {value}"


def _pooled(runs: pd.DataFrame, match: Match, name: str, value: Any) -> pd.DataFrame | str:
    """Returns the runs at all these values, if there are equally many of each: only then is a mean
    over runs one over the values."""
    chosen = matching(runs, match)
    for column, patterns in match.items():
        counts = {p: len(matching(chosen, {column: p})) for p in patterns}
        if min(counts.values()) == 0:
            return f"no run with {column} {min(counts, key=lambda p: counts[p])} ({name} = {value})"
        if len(set(counts.values())) > 1:
            told = ", ".join(f"{count} of {pattern}" for pattern, count in counts.items())
            return f"{name} = {value} needs equally many runs, there are {told}"
    return chosen
