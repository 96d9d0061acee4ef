# SPDX-License-Identifier: Apache-2.0
"""`import slambed`: results as DataFrames, and campaigns from Python.

from slambed import Results, run
results = Results("results/quickstart")
results.runs.groupby("label").ate_rmse_m.median()
results.events("frame_tracked").groupby("cell").track_ms.quantile(0.95)
"""

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from slambed.data.trajectory import Trajectory
from slambed.errors import ExitCode, SlambedError
from slambed.metrics.collect import EVENTS, events_file, events_today
from slambed.report.load import load

OF_A_RUN = ("run_key", "cell", "label", "repetition", "seed")
"""Columns of `Results.runs` that are put before those of every table per run."""
TRAJECTORIES = {"final": "trajectory.txt", "live": "trajectory_live.txt"}


class Results:
    """The results folder of an experiment. Raises SlambedError when the folder has no results."""

    def __init__(self, folder: str | Path) -> None:
        self._loaded = load(Path(folder))
        if not len(self._loaded.runs):
            raise SlambedError(
                f"no results, {folder} has no readable run, run the experiment first"
            )
        self.folder = self._loaded.folder
        self.title = self._loaded.title

    def __repr__(self) -> str:
        """Returns folder, experiment, systems, runs and valid runs in one line."""
        return repr(self._loaded)

    @property
    def runs(self) -> pd.DataFrame:
        """Returns one row per run: the keys of summary.json (docs/reference/summary.md), `label`,
        `params.<name>`."""
        return self._loaded.runs

    @property
    def valid_runs(self) -> pd.DataFrame:
        return self._loaded.valid_runs

    @property
    def problems(self) -> list[str]:
        """Returns what is damaged, missing or unknown in the folder."""
        return self._loaded.problems

    @property
    def cells(self) -> pd.DataFrame:
        """Returns one row per cell: the number of valid `runs`, and the median of every number over
        them."""
        numbers = [key for key in self._loaded.numbers() if key not in OF_A_RUN]
        valid = self.valid_runs[["cell", *numbers]].copy()
        valid[numbers] = valid[numbers].apply(pd.to_numeric, errors="coerce")
        grouped = valid.groupby("cell", sort=False)
        medians = grouped[numbers].median()
        medians.insert(0, "runs", grouped.size())
        return medians

    def events(self, *types: str) -> pd.DataFrame:
        """Returns the events of all valid runs, of these types or of all without one; `t_ns` is run
        time. Columns without a value are left out when types are given, but for `dropped` of
        messages. `problems` says how many runs were kept without these events."""
        folders = [self._loaded.run_dir(str(key)) for key in self.valid_runs["run_key"]]
        without = sum(_events_file(folder, types) is None for folder in folders)
        if without:
            what = f" of {', '.join(types)}" if types else ""
            self._loaded.complain(f"{without} of {len(folders)} runs are without events{what}")
        return self._tables("events", types)

    def samples(self) -> pd.DataFrame:
        """Returns CPU, memory, throttling and RTT of all valid runs, sampled at 10 Hz."""
        return self._tables("samples")

    def link(self) -> pd.DataFrame:
        """Returns the link's time series (requested, applied, probed RTT, drops) of all valid
        runs."""
        return self._tables("link")

    def trajectory(self, run_key: str, which: str = "final") -> pd.DataFrame:
        """Returns camera-to-world poses as t_s, x, y, z, qx, qy, qz, qw; `which`: final or live."""
        if which not in TRAJECTORIES:
            raise SlambedError(f"no trajectory '{which}'; known: {', '.join(TRAJECTORIES)}")
        found = self._loaded.trajectory(run_key, TRAJECTORIES[which])
        return _frame(found, f"run {run_key} has no {TRAJECTORIES[which]}")

    def groundtruth(self, dataset: str) -> pd.DataFrame:
        """Returns the ground truth of a dataset, with the columns of `trajectory`."""
        return _frame(self._loaded.groundtruth(dataset), f"{dataset} has no ground truth here")

    def _tables(self, name: str, types: tuple[str, ...] = ()) -> pd.DataFrame:
        parts = []
        for row in self.valid_runs[list(OF_A_RUN)].to_dict("records"):
            table = self._table(str(row["run_key"]), name, types)
            if table is None:
                continue
            if types:
                table = table[table["type"].isin(types)].dropna(axis=1, how="all")
                if "message" in types and "dropped" not in table:
                    table = table.assign(dropped=False)
            for column, value in reversed(list(row.items())):
                # A column that the table already has under this name is kept.
                if column not in table:
                    table.insert(0, column, value)
            parts.append(table)
        parts = [part for part in parts if len(part)]
        return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=OF_A_RUN)

    def _table(self, key: str, name: str, types: tuple[str, ...]) -> pd.DataFrame | None:
        file = _events_file(self._loaded.run_dir(key), types) if types else None
        if file is None or file.name == EVENTS:
            return self._loaded.table(key, name)
        table = self._loaded.table(key, file.stem)
        return None if table is None else events_today(table)


def _events_file(folder: Path, types: tuple[str, ...]) -> Path | None:
    """Returns the file with all events of a run, or of these types; None if they were not kept."""
    if types:
        return events_file(folder, types)
    return folder / EVENTS if (folder / EVENTS).exists() else None


def run(
    experiment: str | Path | Mapping[str, Any],
    *,
    engine: str | None = None,
    runs: int | None = None,
    results: str | Path = "results",
) -> Results:
    """Executes the missing runs of an experiment, given as a name, a file, or its content with an
    `id`.

    Raises SlambedError where the command `slambed run` would end with an error, and where runs have
    no result. Raises KeyboardInterrupt after Ctrl-C, which first ends the runs under way.
    """
    from slambed.campaign.options import Options
    from slambed.campaign.run_experiment import run_experiment
    from slambed.terminal import console

    options = Options(runs=runs, engine=engine, results=Path(results))
    with tempfile.TemporaryDirectory() as place:
        if isinstance(experiment, Mapping):
            name = str(experiment.get("id", ""))
            path = Path(place) / f"{name}.yaml"
            # JSON is YAML.
            path.write_text(json.dumps(_seen_from_here(experiment)))
            experiment = path
        verdict = run_experiment(str(experiment), options, console())
    if verdict.interrupted:
        raise KeyboardInterrupt
    if verdict.given_up:
        why = next(iter(verdict.given_up.values()))
        raise SlambedError(
            f"{len(verdict.given_up)} runs have no result: {why}; the same call tries again, "
            f"Results({str(verdict.folder)!r}) has those that are there",
            ExitCode.NOT_ALL_GOOD,
        )
    if verdict.folder is None:
        raise SlambedError("nothing was executed")
    return Results(verdict.folder)


def _seen_from_here(experiment: Mapping[str, Any]) -> dict[str, Any]:
    """Resolves named files against the working directory, because the experiment has no file of its
    own."""

    def seen(named: Any) -> Any:
        is_file = isinstance(named, str) and named.endswith((".yaml", ".yml"))
        return str(Path(named).resolve()) if is_file else named

    content = dict(experiment)
    if isinstance(datasets := content.get("datasets"), list):
        content["datasets"] = [seen(name) for name in datasets]
    if isinstance(systems := content.get("systems"), list):
        content["systems"] = [
            {**choice, "system": seen(choice.get("system"))} if isinstance(choice, dict) else choice
            for choice in systems
        ]
    return content


def _frame(path: Trajectory | None, missing: str) -> pd.DataFrame:
    if path is None:
        raise SlambedError(missing)
    columns = ["t_s", "x", "y", "z", "qx", "qy", "qz", "qw"]
    rows = np.column_stack([path.stamps_s, path.positions_m, path.quaternions_xyzw])
    return pd.DataFrame(rows, columns=columns)
