# SPDX-License-Identifier: Apache-2.0
"""Checks that experiments that reproduce a number make runs for it, and of one kind only.

What a paper's coordinates do not name must be constant over the runs of one number. Reports refuse
such a mixture of runs; the lint finds it before anything runs.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from slambed.papers.lint.checkout import Checkout
from slambed.papers.lint.problem import Problem
from slambed.papers.published.base import Match
from slambed.papers.published.cells import PublishedCell, cells_of
from slambed.papers.published.paper import Paper
from slambed.spec.experiment import Experiment, SystemChoice
from slambed.spec.system import System

SHOWN = 3
"""Most differing values that a problem names."""


@dataclass(frozen=True)
class PlannedCell:
    """One cell of an experiment: what all its runs share."""

    columns: Mapping[str, Any]
    """As in summary.csv, with `params.<name>` and `playback`."""
    datasets: tuple[str, ...]
    """The sequence, or those of which the first available one is played."""
    has_edge: bool


def open_problems(paper: Paper, checkout: Checkout) -> Iterator[Problem]:
    """Yields numbers that an experiment reproduces without making runs for them, or with runs of
    several kinds."""
    by_source: dict[str, list[PlannedCell]] = {}
    for name in checkout.library.experiments():
        experiment, _ = checkout.library.experiment(name)
        sources = paper.sources(set(experiment.reproduces))
        if not sources:
            continue
        planned = list(planned_cells(experiment, checkout))
        for source in sources:
            by_source.setdefault(source, []).extend(planned)
    for cell in cells_of(paper).values():
        claim = cell.claim
        needs_runs = claim is None or (claim.kind == "result" and claim.quantity is None)
        if cell.source in by_source and cell.comparability.judged and needs_runs:
            yield from _of_cell(paper, cell, by_source[cell.source])


def _of_cell(paper: Paper, cell: PublishedCell, planned: list[PlannedCell]) -> Iterator[Problem]:
    found = [item for item in planned if _stands_for(paper, cell, item)]
    if not found:
        yield Problem(cell.id, "an experiment reproduces it and makes no such runs")
        return
    columns = sorted({name for item in found for name in item.columns})
    for name in columns:
        # The link profile does not matter to a system without an edge.
        if name == "profile" and not any(item.has_edge for item in found):
            continue
        values = sorted({str(item.columns.get(name)) for item in found})
        if len(values) > 1:
            message = ", ".join(values[:SHOWN])
            yield Problem(cell.id, f"its runs differ in {name} ({message}), which it leaves open")


def planned_cells(experiment: Experiment, checkout: Checkout) -> Iterator[PlannedCell]:
    """Yields all cells of an experiment; no sequence needs to be available."""
    for choice in experiment.systems:
        system = checkout.systems[choice.system]
        variant = system.choose_variant(choice.variant)
        params = system.resolve(variant, choice.params)
        columns: dict[str, Any] = {"system": choice.system, "variant": variant}
        columns |= {f"params.{name}": value for name, value in params.items()}
        columns["device_mobile"] = _device(experiment, choice, "mobile")
        if system.has_edge:
            columns["device_edge"] = _device(experiment, choice, "edge")
        columns["playback"] = experiment.playback.model_dump_json()
        for dataset in experiment.datasets_of(choice):
            for profile in _profiles(experiment, choice, system):
                datasets = tuple(checkout.first_of(dataset))
                yield PlannedCell(columns | {"profile": profile}, datasets, system.has_edge)


def _device(experiment: Experiment, choice: SystemChoice, role: str) -> str:
    asked = getattr(choice.devices, role) or getattr(experiment.devices, role)
    return asked if isinstance(asked, str) else str(asked.name)


def _profiles(experiment: Experiment, choice: SystemChoice, system: System) -> list[str | None]:
    if not system.has_edge or experiment.link is None:
        return [None]
    if choice.profiles is not None:
        return list(choice.profiles)
    return [
        str(item.get("name") or item.get("profile")) if isinstance(item, dict) else str(item)
        for item in experiment.link.profiles
    ]


def _stands_for(paper: Paper, cell: PublishedCell, planned: PlannedCell) -> bool:
    left = dict(cell.conditions)
    where = paper.datasets[left.pop("dataset")]
    names = (*where.match, *where.stand_in)
    if not any(fnmatchcase(have, wanted) for have in planned.datasets for wanted in names):
        return False
    if not _fits(planned, paper.systems[str(cell.system)].match):
        return False
    return all(_meets(paper, str(cell.system), n, v, planned) for n, v in left.items())


def _meets(paper: Paper, system: str, name: str, value: Any, planned: PlannedCell) -> bool:
    rule = paper.conditions[name]
    if rule == "ignore":
        return True
    if "column" in rule:
        only = rule.get("systems")
        if only and not any(fnmatchcase(system, pattern) for pattern in only):
            return True
        own = planned.columns.get(str(rule["column"]))
        return isinstance(own, int | float) and own == value
    match = rule.get(value, rule.get("*"))
    if set(match) == {"profile"} and not planned.has_edge:
        return True
    return _fits(planned, match)


def _fits(planned: PlannedCell, match: Match) -> bool:
    for column, patterns in match.items():
        wanted = [patterns] if isinstance(patterns, str) else patterns
        own = str(planned.columns.get(column))
        if not any(fnmatchcase(own, pattern) for pattern in wanted):
            return False
    return True
