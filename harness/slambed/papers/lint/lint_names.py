# SPDX-License-Identifier: Apache-2.0
"""Checks that everything named in the head of a paper's file exists in this checkout."""

from collections.abc import Iterator
from typing import Any

from slambed.papers.lint.checkout import SPECIAL_KEYS, Checkout, fits_any
from slambed.papers.lint.problem import Problem
from slambed.papers.lookup import POOL
from slambed.papers.published.base import Match
from slambed.papers.published.mapping import PaperMetric, PaperSystem
from slambed.papers.published.paper import Paper

STATEMENTS = ("about", "reduction")
"""Keys of margins that are not metrics."""


def name_problems(paper: Paper, checkout: Checkout) -> Iterator[Problem]:
    """Yields problems in systems, datasets, conditions, metrics and margins."""
    for name, system in paper.systems.items():
        yield from _system(f"{paper.id}, systems, {name}", system, checkout)
    for name, dataset in paper.datasets.items():
        where = f"{paper.id}, datasets, {name}"
        for pattern in (*dataset.match, *dataset.stand_in):
            if not fits_any(pattern, checkout.datasets):
                yield Problem(where, f"no dataset {pattern}")
        if not dataset.match and not dataset.note:
            yield Problem(where, "no sequence of ours, and no note that says why")
    unbuilt = any(system.not_built for system in paper.systems.values())
    for name, rule in paper.conditions.items():
        yield from _condition(f"{paper.id}, conditions, {name}", rule, unbuilt, checkout)
    for name, metric in paper.metrics.items():
        yield from _metric(f"{paper.id}, metrics, {name}", metric, paper, checkout)
    for name in paper.margins:
        if name not in paper.metrics and name not in STATEMENTS:
            yield Problem(f"{paper.id}, margins, {name}", "no metric of that name")


def _system(where: str, system: PaperSystem, checkout: Checkout) -> Iterator[Problem]:
    names = _patterns(system.match.get("system", []))
    known = {name for name in checkout.systems if any(fits_any(p, {name}) for p in names)}
    variants = {v for name in known for v in (checkout.systems[name].variants or ["default"])}
    if system.not_built:
        wanted = _patterns(system.match.get("variant", ["*"]))
        if any(fits_any(pattern, variants) for pattern in wanted):
            yield Problem(where, f"system {min(known)} is built: take not_built away")
        return
    if not known:
        yield Problem(where, f"no system {' or '.join(names) or 'is named'}")
        return
    for column, patterns in system.match.items():
        for pattern in _patterns(patterns):
            if column == "variant" and not fits_any(pattern, variants):
                yield Problem(where, f"{', '.join(sorted(known))} has no variant {pattern}")
        if column.startswith("params.") and not checkout.has_param(column, known):
            yield Problem(where, f"{', '.join(sorted(known))} has no parameter {column[7:]}")
    rest = {c: p for c, p in system.match.items() if c not in ("system", "variant")}
    yield from _match(where, rest, checkout)


def _condition(where: str, rule: Any, unbuilt: bool, checkout: Checkout) -> Iterator[Problem]:
    if rule == "ignore":
        return
    if not isinstance(rule, dict):
        yield Problem(where, "neither ignore, nor a column, nor values")
        return
    if "column" in rule:
        column = str(rule["column"])
        # Systems that are not built yet may add the parameter.
        if column.startswith("params.") and not unbuilt and not checkout.has_param(column):
            yield Problem(where, f"no system has a parameter {column[7:]}")
        if not column.startswith("params.") and column not in checkout.keys:
            yield Problem(where, f"no column {column}")
        return
    for value, match in rule.items():
        place = f"{where} = {value}"
        if POOL in match and set(match) != {POOL}:
            yield Problem(place, "pool stands alone")
            continue
        over = match.get(POOL, match)
        if POOL in match and not all(isinstance(p, list) and len(p) > 1 for p in over.values()):
            yield Problem(place, "pool needs two or more values of a column")
        yield from _match(place, over, checkout)


def _metric(where: str, metric: PaperMetric, paper: Paper, checkout: Checkout) -> Iterator[Problem]:
    for key in (metric.key, *metric.plus, *(reading.key for reading in metric.other_readings)):
        if not checkout.has_key(key):
            yield Problem(where, f"no number of a run is called {key}")
    if (metric.key in SPECIAL_KEYS) != (metric.reference is not None):
        yield Problem(where, f"{metric.key}: a reference is named where one is needed, only there")
    if metric.reference is not None and metric.reference not in paper.systems:
        yield Problem(where, f"reference: no system {metric.reference}")
    yield from _match(where, metric.only, checkout)


def _match(where: str, match: Match, checkout: Checkout) -> Iterator[Problem]:
    known = {"profile": checkout.profiles, "dataset": checkout.datasets,
             "device_mobile": checkout.devices, "device_edge": checkout.devices}  # fmt: skip
    for column, patterns in match.items():
        if not column.startswith("params.") and column not in checkout.keys:
            yield Problem(where, f"no column {column}")
        for pattern in _patterns(patterns):
            if column in known and not fits_any(pattern, known[column]):
                yield Problem(where, f"no {column.replace('_', ' ')} {pattern}")


def _patterns(patterns: str | list[str]) -> list[str]:
    return [patterns] if isinstance(patterns, str) else patterns
