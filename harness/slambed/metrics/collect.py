# SPDX-License-Identifier: Apache-2.0
"""Events, samples and link log of a run, from its raw files or from those of its result."""

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from slambed.files.atomic import replacing
from slambed.metrics.event_columns import (
    EXTRA_COLUMN,
    LINK_COLUMNS,
    SAMPLE_COLUMNS,
    Columns,
    frame_of,
    table_of_frame,
)
from slambed.metrics.events import Event, EventLog, read_events, read_jsonl
from slambed.older_names import FIELDS, OF_VALUES, event_today, types_then

EVENTS = "events.parquet"


def read_log(folder: Path) -> EventLog:
    """Events of a raw folder (events.jsonl of the nodes) or of a result (events.parquet)."""
    return stored_log(folder / EVENTS) if is_stored(folder) else read_events(folder)


def is_stored(folder: Path) -> bool:
    """Whether it is a result's: what its events say is no raw log any more."""
    return (folder / EVENTS).exists()


def stored_log(path: Path, types: Sequence[str] | None = None) -> EventLog:
    """The events (of these types) of a result, as the nodes wrote them: without nulls, ids whole
    numbers of 64 bits, what the schema does not know unpacked."""
    try:
        with pq.ParquetFile(path) as file:
            table = file.read(use_threads=False)
        if types:
            table = table.filter(pc.is_in(table["type"], pa.array(types_then(types))))
    except (OSError, KeyError, pa.ArrowException) as error:
        return EventLog([], [f"{path.name}: unreadable ({str(error).splitlines()[0]})"])
    filled = [name for name in table.column_names if table[name].null_count < len(table)]
    events: list[Event] = []
    for row in table.select(filled).to_pylist():
        event = {key: value for key, value in row.items() if value is not None}
        if (extra := event.pop(EXTRA_COLUMN, None)) is not None:
            event |= json.loads(extra)
        events.append(event_today(event))
    return EventLog(events)


def events_today(table: pd.DataFrame) -> pd.DataFrame:
    """The table of a result's events in today's words."""
    renamed = table.rename(columns={old: new for old, new in FIELDS.items() if new not in table})
    for column, names in OF_VALUES.items():
        if column in renamed:
            renamed[column] = renamed[column].replace(names)
    return renamed


def read_samples(raw_dir: Path) -> tuple[pd.DataFrame, list[str]]:
    """Samples of a raw folder (samples.jsonl) or of a result (samples.parquet)."""
    if (parquet := raw_dir / "samples.parquet").exists():
        return _read_parquet(parquet, SAMPLE_COLUMNS)
    path = raw_dir / "samples.jsonl"
    if not path.exists():
        return _empty(SAMPLE_COLUMNS), ["samples.jsonl: missing, no CPU and memory figures"]
    rows, problems = read_jsonl(path)
    return frame_of(rows, SAMPLE_COLUMNS), problems


def read_link(raw_dir: Path) -> tuple[pd.DataFrame | None, list[str]]:
    """The link log: link.parquet, or all t_s/series/value files in link/; None without a link."""
    folder = raw_dir / "link"
    for whole in (raw_dir / "link.parquet", folder / "link.parquet"):
        if whole.exists():
            return _read_parquet(whole, LINK_COLUMNS)
    if not folder.is_dir():
        return None, []
    parts: list[pd.DataFrame] = []
    problems: list[str] = []
    for path in sorted(folder.iterdir()):
        if path.suffix == ".jsonl":
            rows, complaints = read_jsonl(path)
            part = frame_of(rows, LINK_COLUMNS)
        elif path.suffix == ".csv":
            part, complaints = _read_csv(path)
        elif path.suffix == ".parquet":
            part, complaints = _read_parquet(path, LINK_COLUMNS)
        else:
            continue  # logs and packet captures stay what they are
        problems += complaints
        part = part.dropna(subset=["t_s", "series"])
        if len(part):
            parts.append(part)
    if not parts:
        return _empty(LINK_COLUMNS), [*problems, "link/: no series found, the RTT is unproven"]
    return pd.concat(parts, ignore_index=True).sort_values("t_s", kind="stable"), problems


def keep_groundtruth(experiment_dir: Path, dataset: str, groundtruth: Path) -> Path:
    """Copies the true path to `<experiment>/groundtruth/<dataset>.txt`, unless it is there: reports
    need it later, and evo reads it. A corrected one takes the place of the old one; where there is
    none any more (a cache was emptied), the kept one stays."""
    target = experiment_dir / "groundtruth" / f"{dataset.replace('/', '_')}.txt"
    if target.exists() and (
        not groundtruth.exists() or target.read_bytes() == groundtruth.read_bytes()
    ):
        return target
    target.parent.mkdir(parents=True, exist_ok=True)
    with replacing(target, rivals=True) as copy:
        shutil.copyfile(groundtruth, copy)
    return target


def _read_csv(path: Path) -> tuple[pd.DataFrame, list[str]]:
    try:
        table = pd.read_csv(path, on_bad_lines="skip")
    except (OSError, ValueError) as error:
        return _empty(LINK_COLUMNS), [f"{path.name}: unreadable ({error})"]
    if not set(LINK_COLUMNS) <= set(table.columns):
        return _empty(LINK_COLUMNS), []
    return pd.DataFrame(table_of_frame(table, LINK_COLUMNS, []).to_pandas()), []


def _read_parquet(path: Path, columns: Columns) -> tuple[pd.DataFrame, list[str]]:
    try:
        table = pq.read_table(path).to_pandas()
    except (OSError, pa.ArrowException) as error:
        return _empty(columns), [f"{path.name}: unreadable ({str(error).splitlines()[0]})"]
    for name in columns:
        if name not in table:
            table[name] = None
    return pd.DataFrame(table), []


def _empty(columns: Columns) -> pd.DataFrame:
    return frame_of([], columns)
