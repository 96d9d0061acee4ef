# SPDX-License-Identifier: Apache-2.0
"""Finds where each published number of a plan is measured: rows, datasets and profiles of
experiments."""

import json
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console

from slambed.campaign.plan import Plan
from slambed.campaign.run_estimate import expected_run_s
from slambed.campaign.run_experiment import plan_virtually
from slambed.files.yaml_source import YamlSource
from slambed.infer.inference_plan import YAML, Inference
from slambed.link.named_profile import read_profile
from slambed.papers.lookup import find_runs
from slambed.papers.margins import published_of
from slambed.papers.published import Paper, PublishedCell, cells_of
from slambed.papers.verdicts.model import Mean, Share
from slambed.spec.library import Library
from slambed.spec.matrix import label_of, read_profiles
from slambed.spec.run_spec import RunSpec
from slambed.spec.system import System
from slambed.suggestion import suggestion


@dataclass(frozen=True)
class Slot:
    """One cell of an experiment in its file."""

    experiment: str
    row: int
    """Index into the experiment's systems, with its grid written out."""
    dataset: str
    """Name in the experiment."""
    profile: str | None


@dataclass(frozen=True)
class Place:
    """A published number and the cells where we measure it."""

    cell: PublishedCell
    printed: Share | Mean
    slots: tuple[Slot, ...]
    stand_in: bool
    dataset: str
    """The dataset that is played."""


@dataclass(frozen=True)
class Base:
    """An experiment that the plan names."""

    name: str
    plan: Plan
    source: YamlSource
    systems: tuple[System, ...]
    profiles: tuple[str, ...]
    """Names of its link's profiles, in the order of its file."""
    run_s: float
    """A first guess at how long one run takes."""


@dataclass
class Places:
    """Everything that a plan refers to, found in experiments and paper."""

    paper: Paper
    bases: dict[str, Base]
    places: dict[str, Place]
    """Maps a published number to where it is measured."""
    paper_systems: dict[tuple[str, int], set[str]] = field(default_factory=dict)
    """Maps (experiment, row) to the paper's names of the system."""

    def slots(self, cells: Iterable[str]) -> list[Slot]:
        """Returns the slots of these numbers, without duplicates."""
        return list(dict.fromkeys(s for c in cells for s in self.places[c].slots))


def find_places(plan: Inference, source: YamlSource, paper: Paper, console: Console) -> Places:
    """Finds all numbers of a plan. Raises SlambedError, with a location in the plan's file, for a
    number that is not printed, cannot be fitted, or has no cell in the plan's experiments."""
    cells = cells_of(paper)
    wanted = [("fit", i, c) for i, c in enumerate(plan.fit)]
    wanted += [("held_out", i, c) for i, c in enumerate(plan.held_out)]
    printed = {name: _printed(paper, source, cells, kind, name) for kind, _, name in wanted}
    settings = [f"playback.{key}={json.dumps(value)}" for key, value in plan.playback.items()]
    near = source.path.parent
    found_bases = [_base(name, near, settings, console) for name in plan.experiments]
    bases = {base.name: base for base in found_bases}
    frames = {name: _frame(base) for name, base in bases.items()}
    found = Places(paper, bases, {})
    for kind, _, name in wanted:
        place = _place(cells[name], printed[name], bases, frames, paper)
        if isinstance(place, str):
            raise source.complaint(f"{name}: {place}", (kind,), "name an experiment that has it")
        found.places[name] = place
        for slot in place.slots:
            called = found.paper_systems.setdefault((slot.experiment, slot.row), set())
            called.add(str(cells[name].system))
    return found


def _printed(
    paper: Paper, source: YamlSource, cells: dict[str, PublishedCell], kind: str, name: str
) -> Share | Mean:
    if name not in cells:
        message = f"{name} is no number of papers/{paper.id}/paper.yaml"
        raise source.complaint(message, (kind,), suggestion(name, list(cells)))
    cell = cells[name]
    metric = paper.metrics.get(cell.metric)
    if metric is None or not cell.comparability.judged:
        raise source.complaint(f"{name} is nothing that our runs measure", (kind,))
    erratum = cell.comparability.erratum
    if erratum is not None and isinstance(erratum.judge_as, str):
        message = f"{name} is printed wrongly, {erratum.judge_as} stands for it"
        raise source.complaint(message, (kind,), "name that")
    if erratum is not None and erratum.judge_as is not None:
        cell = replace(cell, value=float(erratum.judge_as))
    value = published_of(cell, metric.statistic == "share")
    if value is None:
        raise source.complaint(f"the paper prints no count or mean at {name}", (kind,))
    if kind == "fit" and not isinstance(value, Share):
        raise source.complaint(
            f"{name} is no count of runs: only counts are fitted", (kind,), "hold it out"
        )
    if isinstance(value, Mean) and value.count is None:
        message = f"the paper prints no number of runs at {name}, so nothing predicts it"
        raise source.complaint(message, (kind,))
    return value


def _base(name: str, near: Path, settings: list[str], console: Console) -> Base:
    path = str(near / name) if name.endswith(YAML) else name
    plan, source = plan_virtually(path, settings, console)
    library = Library()
    systems = tuple(library.system(choice.system) for choice in plan.experiment.systems)
    profiles = tuple(p.name for p in read_profiles(plan.experiment, source, read_profile))
    return Base(plan.experiment.id, plan, source, systems, profiles, expected_run_s(plan))


def _frame(base: Base) -> pd.DataFrame:
    """Returns the cells of an experiment as a table for `find_runs`."""
    choices = base.plan.experiment.systems
    labels = [label_of(c, s) for c, s in zip(choices, base.systems, strict=True)]
    for label in labels:
        if labels.count(label) > 1:
            message = f"two rows of {base.name} are called '{label}'"
            raise base.source.complaint(message, ("systems",), "give them labels")
    names = {found: name for name, (found, _) in base.plan.circumstances.datasets.items()}
    rows = [_row(spec, labels.index(spec.label), names[spec.dataset]) for spec in base.plan.specs]
    return pd.DataFrame(rows)


def _row(spec: RunSpec, row: int, dataset: str) -> dict[str, Any]:
    return {
        "system": spec.system, "variant": spec.variant, "dataset": spec.dataset,
        "profile": spec.profile, "device_mobile": spec.device_mobile.name,
        "device_edge": spec.device_edge.name if spec.device_edge else None,
        "engine": spec.engine, "link_backend": spec.link.backend if spec.link else None,
        "row": row, "named": dataset,
        **{f"params.{name}": value for name, value in spec.params.items()},
    }  # fmt: skip


def _place(
    cell: PublishedCell,
    printed: Share | Mean,
    bases: dict[str, Base],
    frames: dict[str, pd.DataFrame],
    paper: Paper,
) -> Place | str:
    """Returns where it is measured in the first experiment that has it, else why it is not."""
    why = f"no experiment of the plan reproduces {cell.source}"
    for name, base in bases.items():
        if cell.source not in paper.sources(set(base.plan.experiment.reproduces)):
            continue
        found = find_runs(paper, frames[name], cell.system, cell.conditions)
        if found.runs is None:
            why = found.reason
            continue
        runs = found.runs
        if runs["link_backend"].isna().all():
            # Without an edge, the run is the same under every profile.
            runs = runs.drop_duplicates(["row", "named"])
        slots = tuple(
            Slot(name, int(run["row"]), str(run["named"]), run["profile"])
            for run in runs.to_dict("records")
        )
        return Place(cell, printed, slots, found.stand_in, found.dataset)
    return why
