# SPDX-License-Identifier: Apache-2.0
"""Finds a run and reads what its time line needs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.parquet as pq

from slambed.campaign.folder import read_object
from slambed.errors import SlambedError
from slambed.metrics.collect import read_link
from slambed.metrics.events import read_events
from slambed.metrics.faults import Span, spans
from slambed.spec.matrix import run_name

NS_PER_S = 1e9
LEAST_DIGITS = 4


@dataclass(frozen=True)
class RunLog:
    """One run: events of both nodes with `t_s` added, the link's series, and what it is called."""

    folder: Path
    title: str
    events: pd.DataFrame
    link: pd.DataFrame | None

    def of(self, *types: str, node: str | None = None) -> pd.DataFrame:
        """Events of these types in order of time."""
        found = self.events[self.events["type"].isin(types)]
        return found if node is None else found[found["node"] == node]

    @property
    def end_s(self) -> float:
        """Run time of the last event."""
        return float(self.events["t_s"].max()) if len(self.events) else 0.0

    def losses_s(self) -> list[float]:
        """Run times at which tracking was lost."""
        return [float(t) for t in self.of("track_lost")["t_s"]]

    def faults(self) -> list[Span]:
        """What went wrong on purpose."""
        rows = self.of("fault_began", "fault_ended").to_dict("records")
        return spans({str(key): value for key, value in row.items()} for row in rows)

    def frame_times_s(self) -> list[float]:
        """Run times at which each tracked frame was done."""
        return [float(t) for t in self.of("frame_tracked")["t_s"]]


def find_run(run: str, results: Path) -> Path:
    """A run folder by its path, or by its key or the beginning of it."""
    if (folder := Path(run)).is_dir():
        return folder
    if len(run) >= LEAST_DIGITS:
        found = sorted(path for path in results.glob(f"*/runs/{run}*") if path.is_dir())
        if len(found) == 1:
            return found[0]
        if found:
            names = ", ".join(path.name for path in found[:5])
            raise SlambedError(f"run '{run}' is not clear, {results}: {names}; give more digits")
    raise SlambedError(
        f"no run '{run}' in {results}; give a run folder or at least 4 digits of a key"
    )


def read_run(folder: Path) -> RunLog:
    """Reads a result's run folder or a raw folder."""
    if (parquet := folder / "events.parquet").is_file():
        events = pq.read_table(parquet).to_pandas()
    else:
        events = pd.DataFrame(read_events(folder).events)
    if events.empty:
        raise SlambedError(f"no events in {folder}; give the folder of one run")
    events = pd.DataFrame(events.assign(t_s=events["t_ns"] / NS_PER_S))
    link, _ = read_link(folder)
    return RunLog(folder, _title(folder), events, link)


def _title(folder: Path) -> str:
    manifest: dict[str, Any] = read_object(folder / "manifest.json") or {}
    spec = manifest.get("spec") or {}
    if not spec:
        return folder.name
    parts = [run_name(manifest.get("cell"), manifest.get("repetition"))]
    return ", ".join([*parts, f"engine {spec.get('engine')}", str(manifest.get("run_key"))])
