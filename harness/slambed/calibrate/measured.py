# SPDX-License-Identifier: Apache-2.0
"""Collects the stage times of live runs."""

from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from slambed.errors import SlambedError
from slambed.metrics.collect import events_today
from slambed.metrics.events import read_events
from slambed.records.manifest import Manifest

COLUMNS = ["node", "name", "n1", "n2", "cpu_ms", "wall_ms"]


def stages_of(paths: list[Path]) -> pd.DataFrame:
    """Stage events of all runs below the paths: run folders, raw folders or whole experiments."""
    tables = []
    for path in paths:
        runs = run_folders(path)
        if not runs:
            raise SlambedError(f"no run with events in {path}; give a run or a result folder")
        for run in runs:
            manifest = Manifest.read(run / "manifest.json")
            if manifest is not None and manifest.kept.is_virtual:
                raise SlambedError(
                    f"{run} is a virtual run, its times come from a cost model; give live runs"
                )
            tables.append(_stages(run))
    return pd.concat(tables, ignore_index=True)


def run_folders(path: Path) -> list[Path]:
    """The run folders at or below a path, in order of their names."""
    if _has_events(path):
        return [path]
    below = path / "runs" if (path / "runs").is_dir() else path
    return sorted(folder for folder in below.glob("*") if _has_events(folder))


def _has_events(folder: Path) -> bool:
    return (folder / "events.parquet").is_file() or (folder / "mobile/events.jsonl").is_file()


def _stages(run: Path) -> pd.DataFrame:
    if (parquet := run / "events.parquet").is_file():
        try:
            table = pq.read_table(parquet, columns=["type", *COLUMNS]).to_pandas()
        except (OSError, pa.ArrowException) as error:
            why = str(error).partition("\n")[0]
            raise SlambedError(f"{parquet} is damaged: {why}; leave that run out") from None
        return events_today(pd.DataFrame(table[table["type"] == "stage"][COLUMNS]))
    events = [{key: e.get(key) for key in COLUMNS} for e in read_events(run).of("stage")]
    return pd.DataFrame(events, columns=COLUMNS)
