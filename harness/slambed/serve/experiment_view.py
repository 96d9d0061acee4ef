# SPDX-License-Identifier: Apache-2.0
"""Content of an experiment's page: cells, tables, figures and runs that pass the filters."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from slambed.files.json_file import read_list
from slambed.metrics.catalog import metric
from slambed.metrics.metric import Metric
from slambed.report.cells import Cell, cells_of, metrics_to_show, number, text
from slambed.report.compute_times import compute_times
from slambed.report.load import Results, load
from slambed.report.not_measured import not_measured
from slambed.report.overview import Overview, overviews
from slambed.report.tables import Table, cell_tables
from slambed.serve.guard import PART
from slambed.spec.run_spec import run_name

MOST_RUNS = 300
FILTERS = {"system": "label", "dataset": "dataset", "link": "profile"}
"""Maps a filter of the page to the column of the runs."""
NO_LINK = "no link"
VALIDITY = {"yes": True, "no": False}


@dataclass(frozen=True)
class RunFilter:
    """The filters in a page's address; without any, all runs pass."""

    values: Mapping[str, str] = field(default_factory=dict)
    valid: bool | None = None

    @classmethod
    def of_query(
        cls, query: Mapping[str, list[str]], options: Mapping[str, list[str]]
    ) -> "RunFilter":
        """Parses a query: the last value of each filter counts, and unknown values are ignored."""
        given = {name: found[-1] for name, found in query.items() if found}
        values = {name: given[name] for name in FILTERS if given.get(name) in options[name]}
        return cls(values, VALIDITY.get(given.get("valid", "")))

    def of_runs(self, runs: pd.DataFrame) -> pd.DataFrame:
        """Returns the runs that pass the filters."""
        keep = pd.Series(True, index=runs.index)
        for name, wanted in self.values.items():
            keep &= runs[FILTERS[name]].map(lambda v: text(v) or NO_LINK) == wanted
        if self.valid is not None:
            keep &= runs["valid"].eq(True) == self.valid
        return runs[keep]


@dataclass(frozen=True)
class LoadedExperiment:
    """An experiment's runs with the estimates of its cells, which takes time for large ones."""

    results: Results
    metrics: list[Metric]
    cells: list[Cell]

    @classmethod
    def of(cls, folder: Path) -> "LoadedExperiment":
        """Loads an experiment; damaged files become lines in its problems."""
        results = load(folder)
        for time in compute_times(results):
            if (warning := time.warning(results.name)) is not None:
                results.complain(warning)
        for line in not_measured(results):
            results.complain(line)
        metrics = metrics_to_show(results)
        return cls(results, metrics, cells_of(results, metrics))

    def options(self) -> dict[str, list[str]]:
        """Returns the values of each filter, in the order of the cells."""
        runs = self.results.runs
        return {
            name: list(dict.fromkeys(runs[column].map(lambda v: text(v) or NO_LINK)))
            for name, column in FILTERS.items()
        }

    def tables(self, chosen: RunFilter) -> list[Table]:
        """Returns the estimates of the cells with a run that passes the filters. Numbers always
        cover all valid runs of a cell: a filter hides cells, but changes no number."""
        names = set(chosen.of_runs(self.results.runs)["cell"])
        return cell_tables([cell for cell in self.cells if cell.name in names], self.metrics)

    def pictures(self, chosen: RunFilter) -> list[Overview]:
        """Returns the median runs of the cells with a run that passes the filters, over time."""
        names = set(chosen.of_runs(self.results.runs)["cell"])
        part = self.results.only([cell in names for cell in self.results.runs["cell"]])
        return overviews(part, lambda key: f"runs/{key}/")

    def runs(self, chosen: RunFilter) -> tuple[list[dict[str, Any]], int]:
        """Returns the runs that pass the filters, and how many more there are than a page shows."""
        found = chosen.of_runs(self.results.runs)
        rows = found.head(MOST_RUNS).to_dict("records")
        return [_run({str(k): v for k, v in row.items()}) for row in rows], max(
            0, len(found) - MOST_RUNS
        )


def figures_of(folder: Path) -> list[dict[str, str]]:
    """Returns the existing figures of an experiment's last report; files are names inside
    `report/`. Entries with unsafe names are left out."""
    found: list[dict[str, str]] = []
    for item in read_list(folder / "report" / "figures.json"):
        name = item.get("name") if isinstance(item, dict) else None
        if not isinstance(name, str) or not PART.match(name):
            continue
        if (folder / "report" / f"{name}.svg").is_file():
            points = f"{name}.points.json"
            there = (folder / "report" / points).is_file()
            texts = {key: str(item.get(key) or "") for key in ("title", "caption", "data")}
            found.append({"name": name, "points": points if there else "", **texts})
    return found


def _run(row: dict[str, Any]) -> dict[str, Any]:
    valid, completed = row["valid"] is True, row["outcome"] == "completed"
    outcome = text(row["outcome"]).replace("_", " ")
    if not completed and text(row["outcome_reason"]):
        outcome += f": {row['outcome_reason']}"
    if not valid:
        outcome += f"; invalid: {text(row['invalid_reason']) or 'no reason was kept'}"
    losses = number(row["track_losses"])
    return {
        "key": row["run_key"],
        "name": run_name(row["cell"], row["repetition"]),
        "outcome": outcome,
        "mood": "" if valid and completed else "bad",
        "coverage": metric("coverage").show(number(row["coverage"])),
        "losses": "-" if losses is None else f"{losses:.0f}",
        "ate": metric("ate_rmse_m").show(number(row["ate_rmse_m"])),
    }
