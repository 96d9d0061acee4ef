# SPDX-License-Identifier: Apache-2.0
"""Executes the runs of points with the campaign engine, and counts their losses.

Each stage is written as ordinary experiments, which `slambed run` accepts too. Their runs are
stored by key, so a second call repeats none.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd
import yaml
from rich.console import Console

from slambed.campaign.options import Options
from slambed.campaign.run_experiment import run_experiment
from slambed.campaign.runner import CampaignOutcome
from slambed.errors import SlambedError
from slambed.files.outputs import make_folder
from slambed.files.yaml_source import load_yaml
from slambed.infer.design import Point
from slambed.infer.mixture import Counts
from slambed.infer.rows import Made, Rows
from slambed.papers.lookup import Found, Pool, matching
from slambed.papers.measured import Measured, values_of
from slambed.papers.power import seconds_per_run
from slambed.process.cpus import own_cpus
from slambed.report.load import load
from slambed.spec.device import VIRTUAL

LEFT_OUT = ("grid", "reproduces", "report")
"""Keys that are not copied from an experiment's file into one derived from it."""


class StoppedError(Exception):
    """The user interrupted a stage."""


@dataclass
class Campaign:
    """Executes the stages of one plan."""

    rows: Rows
    name: str
    """Name of the plan and its form, the prefix of its experiments."""
    folder: Path
    options: Options
    console: Console
    asked: set[tuple[Made, int]] = field(default_factory=set)
    """Every (cell, repetition) requested so far, over all stages."""
    runs: list[pd.DataFrame] = field(default_factory=list)
    """Runs read so far, used to check the plan they were made under."""
    verdicts: list[CampaignOutcome] = field(default_factory=list)
    stages: int = 0
    stand_ins: set[str] = field(default_factory=set)
    """Datasets that were played instead of the paper's sequence."""

    def cells_of(self, points: Iterable[Point], cells: Iterable[str]) -> set[Made]:
        """Returns the cells that these numbers need at these points."""
        slots = self.rows.places.slots(cells)
        return {self.rows.made(slot, point) for point in points for slot in slots}

    def further(self, points: Iterable[Point], cells: Iterable[str], runs: int) -> int:
        """Returns how many runs these would add to those requested so far."""
        wanted = {(made, k) for made in self.cells_of(points, cells) for k in range(runs)}
        return len(wanted - self.asked)

    def measure(
        self, stage: str, points: Sequence[Point], cells: Sequence[str], runs: int
    ) -> dict[Point, dict[str, Measured]]:
        """Returns our values at every point, from exactly `runs` runs. Raises StoppedError on an
        interrupt, and SlambedError if a cell has no valid run."""
        self.stages += 1
        pools = self._execute(f"{self.stages}-{stage}", points, cells, runs)
        self.asked |= {(m, k) for m in self.cells_of(points, cells) for k in range(runs)}
        return {p: {c: self._measured(pools, c, p) for c in cells} for p in points}

    def counts(
        self, stage: str, points: Sequence[Point], cells: Sequence[str], runs: int
    ) -> Mapping[Point, Counts]:
        """Returns the values of `measure` as counts. Raises SlambedError if a cell has no value."""
        found = self.measure(stage, points, cells, runs)
        for point, own in found.items():
            for cell, measured in own.items():
                if not measured.there:
                    message = f"nothing is measured for {cell} at {point.words()}"
                    raise SlambedError(f"{message}: {measured.found.reason}")
        return {point: {c: m.share for c, m in own.items()} for point, own in found.items()}

    def seconds_per_run(self) -> float:
        """Returns the time of one run with `jobs` runs in parallel, as measured in earlier stages,
        else a first guess."""
        results = self.options.results
        ledgers = sorted(results.glob(f"{self.name}.*/ledger.jsonl"))
        known = [s for path in ledgers if (s := seconds_per_run(path)) is not None]
        if known:
            return sum(known) / len(known)
        guesses = [base.run_s for base in self.rows.places.bases.values()]
        return max(guesses) / (self.options.jobs or len(own_cpus()))

    def _execute(
        self, stage: str, points: Sequence[Point], cells: Sequence[str], runs: int
    ) -> dict[Made, tuple[Pool, pd.DataFrame]]:
        found: dict[Made, tuple[Pool, pd.DataFrame]] = {}
        for path, own in self._written(stage, points, cells, runs):
            verdict = run_experiment(str(path), self.options, self.console)
            self.verdicts.append(verdict)
            if verdict.interrupted:
                raise StoppedError
            results = load(self.options.results / path.stem)
            valid = results.valid_runs.assign(experiment_folder=results.name)
            valid = valid[pd.to_numeric(valid["repetition"]) < runs]
            self.runs.append(valid)
            pool = Pool(valid, {results.name: results})
            for made in own:
                at = valid["label"].eq(made.label)
                if made.profile is not None:
                    at &= valid["cell"].astype(str).str.endswith(f"/{made.profile}")
                found[made] = (pool, valid[at])
        return found

    def _written(
        self, stage: str, points: Sequence[Point], cells: Sequence[str], runs: int
    ) -> list[tuple[Path, list[Made]]]:
        """Writes the stage's experiments: one per experiment of the plan and dataset."""
        groups: dict[tuple[str, str], dict[str, tuple[dict[str, Any], list[Made]]]] = {}
        for slot in self.rows.places.slots(cells):
            for point in points:
                made = self.rows.made(slot, point)
                group = groups.setdefault((made.experiment, made.dataset), {})
                _, own = group.setdefault(made.label, (self.rows.entry(slot, point), []))
                if made not in own:
                    own.append(made)
        folder = self.folder / "experiments"
        make_folder(folder, "--results")
        found = []
        for (experiment, dataset), rows in groups.items():
            parts = [self.name, stage, experiment]
            if sum(e == experiment for e, _ in groups) > 1:
                parts.append(dataset.replace("/", "-"))
            name = ".".join(parts)
            content = self._experiment(name, experiment, dataset, rows, runs)
            path = folder / f"{name}.yaml"
            text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
            if not path.exists() or load_yaml(path).data != content:
                path.write_text(text, encoding="utf-8")
            found.append((path, [made for _, own in rows.values() for made in own]))
        return found

    def _experiment(
        self,
        name: str,
        experiment: str,
        dataset: str,
        rows: Mapping[str, tuple[dict[str, Any], list[Made]]],
        runs: int,
    ) -> dict[str, Any]:
        base = self.rows.places.bases[experiment]
        plan, asked = self.rows.plan, base.plan.experiment.link
        content = {k: v for k, v in base.source.data.items() if k not in LEFT_OUT}
        content |= {
            "id": name,
            "title": f"{plan.title}: {name.removeprefix(f'{self.name}.')}",
            "datasets": [dataset],
            "engine": VIRTUAL,
            "runs": {"default": runs},
            "seed": plan.seed,
        }
        systems = []
        needed: list[str] = []
        for entry, own in rows.values():
            profiles = [m.profile for m in own if m.profile is not None]
            needed += [p for p in profiles if p not in needed]
            systems.append({**entry, "profiles": profiles} if profiles else entry)
        content["systems"] = systems
        if asked is not None and needed:
            raw = self._profiles(experiment)
            content["link"] = {
                **base.source.data["link"],
                "profiles": [raw.get(p, p) for p in needed],
            }
        else:
            content.pop("link", None)
        return content

    def _profiles(self, experiment: str) -> dict[str, Any]:
        """Maps profile names to the profiles as the experiment's file writes them."""
        base = self.rows.places.bases[experiment]
        written = base.source.data["link"]["profiles"]
        return dict(zip(base.profiles, written, strict=True))

    def _measured(
        self, pools: Mapping[Made, tuple[Pool, pd.DataFrame]], cell: str, point: Point
    ) -> Measured:
        place = self.rows.places.places[cell]
        parts = [pools[self.rows.made(slot, point)] for slot in place.slots]
        runs = pd.concat([own for _, own in parts], ignore_index=True)
        if not len(runs):
            raise SlambedError(f"no run that counts for {cell} at {point.words()}; see its report")
        # The dataset may be an open item, so each run's may be the paper's sequence or a stand-in.
        conditions = dict(place.cell.conditions)
        where = self.rows.places.paper.datasets[str(conditions["dataset"])]
        others = set(runs["dataset"]) - set(matching(runs, {"dataset": where.match})["dataset"])
        self.stand_ins |= {str(name) for name in others}
        found = Found(runs, dataset=place.dataset, stand_in=bool(others))
        pool = Pool(runs, {n: r for pool, _ in parts for n, r in pool.results.items()})
        return values_of(self.rows.places.paper, pool, place.cell.metric, found, conditions)
