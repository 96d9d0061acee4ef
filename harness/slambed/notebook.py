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
from slambed.errors import SlambedError
from slambed.report.load import load

OF_A_RUN = ("run_key", "cell", "label", "repetition", "seed")
"""Columns of `Results.runs` that stand before those of every table of single runs."""
TRAJECTORIES = {"final": "trajectory.txt", "live": "trajectory_live.txt"}


class Results:
    """The results folder of an experiment. Raises SlambedError when it is none."""

    def __init__(self, folder: str | Path) -> None:
        self._loaded = load(Path(folder))
        self.folder = self._loaded.folder
        self.title = self._loaded.title

    def __repr__(self) -> str:
        """Folder, experiment, systems, runs and how many of them count, in a line."""
        return repr(self._loaded)

    @property
    def runs(self) -> pd.DataFrame:
        """One row per run: keys of summary.json, `params.<name>`, `label`."""
        return self._loaded.runs

    @property
    def valid_runs(self) -> pd.DataFrame:
        """Those of them that count."""
        return self._loaded.valid_runs

    @property
    def problems(self) -> list[str]:
        """What is torn, missing or foreign in the folder."""
        return self._loaded.problems

    @property
    def cells(self) -> pd.DataFrame:
        """One row per cell: valid `runs`, and the median of every number over them."""
        numbers = [key for key in self._loaded.numbers() if key not in OF_A_RUN]
        valid = self.valid_runs[["cell", *numbers]].copy()
        valid[numbers] = valid[numbers].apply(pd.to_numeric, errors="coerce")
        grouped = valid.groupby("cell", sort=False)
        medians = grouped[numbers].median()
        medians.insert(0, "runs", grouped.size())
        return medians

    def events(self, *types: str) -> pd.DataFrame:
        """Events of all valid runs (of these types; all without one), run time in `t_ns`;
        columns that no event of these types has are left out."""
        return self._tables("events", types)

    def samples(self) -> pd.DataFrame:
        """CPU, memory, throttling and RTT, ten times a second, of all valid runs."""
        return self._tables("samples")

    def link(self) -> pd.DataFrame:
        """Series of the link (asked, applied, probed RTT, drops) of all valid runs."""
        return self._tables("link")

    def trajectory(self, run_key: str, which: str = "final") -> pd.DataFrame:
        """Camera to world: t_s, x, y, z, qx, qy, qz, qw; `which`: final or live."""
        if which not in TRAJECTORIES:
            raise SlambedError(f"no trajectory '{which}'; known: {', '.join(TRAJECTORIES)}")
        found = self._loaded.trajectory(run_key, TRAJECTORIES[which])
        return _frame(found, f"run {run_key} has no {TRAJECTORIES[which]}")

    def groundtruth(self, dataset: str) -> pd.DataFrame:
        """The true path of a dataset, with the same columns."""
        return _frame(self._loaded.groundtruth(dataset), f"{dataset} has no ground truth here")

    def _tables(self, name: str, types: tuple[str, ...] = ()) -> pd.DataFrame:
        parts = []
        for row in self.valid_runs[list(OF_A_RUN)].to_dict("records"):
            table = self._loaded.table(str(row["run_key"]), name)
            if table is None:
                continue
            if types:
                table = table[table["type"].isin(types)].dropna(axis=1, how="all")
            for column, value in reversed(list(row.items())):
                # What a table has of its own under such a name stays.
                if column not in table:
                    table.insert(0, column, value)
            parts.append(table)
        parts = [part for part in parts if len(part)]
        return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=OF_A_RUN)


def run(
    experiment: str | Path | Mapping[str, Any],
    *,
    engine: str | None = None,
    runs: int | None = None,
    results: str | Path = "results",
) -> Results:
    """Executes what is missing of an experiment: its name, its file, or its content with an `id`.

    Raises SlambedError for what the command `slambed run` refuses.
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
    if verdict.folder is None:
        raise SlambedError("nothing was executed")
    return Results(verdict.folder)


def _seen_from_here(experiment: Mapping[str, Any]) -> dict[str, Any]:
    """Files that it names are seen from where we work: it has no file of its own."""

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
