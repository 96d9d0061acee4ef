# SPDX-License-Identifier: Apache-2.0
"""Reads what the timeline of a run needs."""

from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from slambed.errors import SlambedError
from slambed.link.impairments import outages_within
from slambed.metrics.collect import EVENTS, events_today, read_link, read_samples
from slambed.metrics.event_columns import EVENT_COLUMNS, frame_of
from slambed.metrics.events import EventLog, read_events
from slambed.metrics.faults import Span, spans
from slambed.metrics.stages import longest_stall
from slambed.metrics.summary import Summary
from slambed.records.manifest import Manifest
from slambed.spec.device import VIRTUAL
from slambed.spec.run_spec import run_name

NS_PER_S = 1e9


@dataclass(frozen=True)
class RunStatus:
    """How the run ended and whether it is valid, from its summary."""

    outcome: str = "completed"
    outcome_reason: str | None = None
    valid: bool = True
    invalid_reason: str | None = None
    attempts: int = 1
    steal_percent: float | None = None
    """Steal time, in percent of the host's CPU time over playback."""
    virtual: bool = False


@dataclass(frozen=True)
class RunLog:
    """One run: events of both nodes with `t_s` (run time in s), the link's series, and its
    title."""

    folder: Path
    title: str
    events: pd.DataFrame
    link: pd.DataFrame | None
    status: RunStatus = RunStatus()
    samples: pd.DataFrame = field(default_factory=pd.DataFrame)
    outages_s: tuple[tuple[float, float], ...] = ()
    """Begin and end of the link's outages."""

    def of(self, *types: str, node: str | None = None) -> pd.DataFrame:
        """Returns the events of these types, optionally of one node."""
        found = self.events[self.events["type"].isin(types)]
        return found if node is None else found[found["node"] == node]

    @property
    def end_s(self) -> float:
        """Returns the run time of the last event."""
        return float(self.events["t_s"].max()) if len(self.events) else 0.0

    def losses_s(self) -> list[float]:
        return [float(t) for t in self.of("track_lost")["t_s"]]

    def faults(self) -> list[Span]:
        rows = self.of("fault_began", "fault_ended").to_dict("records")
        return spans({str(key): value for key, value in row.items()} for row in rows)

    def steal_percent(self, begin_s: float, end_s: float) -> float | None:
        """Returns the steal time in this interval, in percent of one CPU; None if unknown."""
        if "host_steal_s" not in self.samples:
            return None
        rows = self.samples.dropna(subset=["host_steal_s"])
        if "node" in rows and rows["node"].eq("edge").any():
            # Rows of a mobile node on a board hold the board's counter.
            rows = rows[rows["node"].eq("edge")]
        rows = rows[rows["t_s"].between(begin_s, end_s)].sort_values("t_s")
        if len(rows) < 2 or rows["t_s"].iloc[-1] <= rows["t_s"].iloc[0]:
            return None
        first, last = rows.iloc[0], rows.iloc[-1]
        stolen_s, span_s = last["host_steal_s"] - first["host_steal_s"], last["t_s"] - first["t_s"]
        return float(100.0 * stolen_s / span_s)

    def longest_stall(self) -> tuple[float, float] | None:
        """Returns time [s] and length [ms] of the host's longest stall of the mobile node."""
        if self.status.virtual:
            return None
        rows = self.of("stage").to_dict("records")
        events = [{str(k): v for k, v in row.items() if v == v and v is not None} for row in rows]
        return longest_stall(EventLog(events))


def read_run(folder: Path) -> RunLog:
    """Reads a run from a result or a raw folder. Raises SlambedError if its events are missing or
    damaged."""
    manifest = Manifest.read(folder / "manifest.json")
    stored = (folder / EVENTS).is_file()
    events = _stored_events(folder) if stored else _raw_events(folder)
    if events.empty:
        raise SlambedError(_why_no_events(folder, manifest, stored))
    events = pd.DataFrame(events.assign(t_s=events["t_ns"] / NS_PER_S))
    link, _ = read_link(folder)
    samples, _ = read_samples(folder)
    outages = _outages(manifest, float(events["t_s"].max()))
    return RunLog(folder, _title(folder, manifest), events, link, _status(folder), samples, outages)


def _raw_events(folder: Path) -> pd.DataFrame:
    """Returns the events with all columns of a result, also those that no event has."""
    return frame_of(read_events(folder).events, EVENT_COLUMNS)


def _stored_events(folder: Path) -> pd.DataFrame:
    """Returns the events of a result, with columns that were added after it was stored."""
    path = folder / EVENTS
    try:
        events = events_today(pq.read_table(path).to_pandas())
    except (OSError, pa.ArrowException) as error:
        first = (str(error).splitlines() or [""])[0]
        raise SlambedError(f"{path}: unreadable ({first})") from None
    if missing := [name for name in ("t_ns", "node", "type") if name not in events]:
        raise SlambedError(f"{path}: not the events of a run, without {', '.join(missing)}")
    return events.reindex(columns=list(dict.fromkeys([*EVENT_COLUMNS, *events])))


def _why_no_events(folder: Path, manifest: Manifest | None, stored: bool) -> str:
    """Returns the line for a folder without events: only a result has a summary."""
    if stored:
        return f"{folder}: the system reported no events"
    if not (folder / "summary.json").is_file():
        return f"no events in {folder}; give the folder of one run"
    cell = manifest.cell if manifest is not None and manifest.cell else "*"
    return (
        f"{folder}: its events were not kept: packed runs have all of them only with --whole; "
        f"\"slambed run NAME --force '{cell}'\", with its --engine and --runs, plays it again"
    )


def _outages(manifest: Manifest | None, end_s: float) -> tuple[tuple[float, float], ...]:
    link = manifest.spec.link if manifest is not None and manifest.spec is not None else None
    return tuple(outages_within(link.content, end_s)) if link is not None else ()


def _status(folder: Path) -> RunStatus:
    """Returns the status from the summary; a raw folder has none yet and gets defaults."""
    summary = Summary.read(folder / "summary.json") or Summary()
    known = RunStatus()
    return RunStatus(
        outcome=str(summary.get("outcome") or known.outcome),
        outcome_reason=summary.text("outcome_reason"),
        valid=summary.get("valid") is not False,
        invalid_reason=summary.text("invalid_reason"),
        attempts=int(summary.number("attempts") or known.attempts),
        steal_percent=summary.number("host_steal_percent"),
        virtual=summary.get("engine") == VIRTUAL,
    )


def _title(folder: Path, manifest: Manifest | None) -> str:
    if manifest is None or manifest.spec is None:
        return folder.name
    parts = [run_name(manifest.cell, manifest.repetition)]
    return ", ".join([*parts, f"engine {manifest.spec.engine}", str(manifest.run_key)])
