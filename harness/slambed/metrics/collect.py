# SPDX-License-Identifier: Apache-2.0
"""Reads events, samples and link log of a run from its raw folder or its stored result."""

import json
import shutil
from collections.abc import Collection, Sequence
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from slambed.errors import SlambedError
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
SOME_EVENTS = "some_events.parquet"
"""Events of some types, of a run that was packed without all of them."""
TYPES_KEY = b"slambed_types"
"""Metadata of SOME_EVENTS: the types that were asked for, also those that never happened."""


def read_log(folder: Path) -> EventLog:
    """Reads the events of a raw folder (events.jsonl of the nodes) or of a result
    (events.parquet)."""
    return stored_log(folder / EVENTS) if is_stored(folder) else read_events(folder)


def is_stored(folder: Path) -> bool:
    """Returns whether the folder is a stored result, which has no raw logs."""
    return (folder / EVENTS).exists()


def stored_log(path: Path, types: Sequence[str] | None = None) -> EventLog:
    """Returns the events (of these types) of a result as the nodes wrote them: without nulls,
    with 64-bit integer ids, and with extra fields unpacked."""
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


def write_some_events(events: Path, types: Collection[str], target: Path) -> dict[str, int]:
    """Writes the events of these types, for a file that is compressed as a whole; returns how many
    there are of each. Raises SlambedError if the events cannot be read."""
    try:
        with pq.ParquetFile(events) as file:
            table = file.read(use_threads=False)
    except (OSError, pa.ArrowException) as error:
        raise SlambedError(f"{events}: unreadable ({str(error).splitlines()[0]})") from None
    table = table.filter(pc.is_in(table["type"], pa.array(types_then(types))))
    filled = [name for name in table.column_names if table[name].null_count < len(table)]
    # Without rows no column is filled, and readers look for this one.
    kept = table.select([name for name in table.column_names if name in {"type", *filled}])
    named = kept.replace_schema_metadata({TYPES_KEY: ",".join(sorted(types)).encode()})
    pq.write_table(named, target, compression="none")
    return {
        kind: int(pc.sum(pc.is_in(kept["type"], pa.array(types_then([kind])))).as_py() or 0)
        for kind in types
    }


def events_file(folder: Path, types: Collection[str]) -> Path | None:
    """Returns the file of a result that has all its events of these types; None if they were not
    kept."""
    if (whole := folder / EVENTS).exists():
        return whole
    some = folder / SOME_EVENTS
    kept = types_kept(some)
    return some if kept and set(types) <= set(kept) else None


def types_kept(some: Path) -> list[str]:
    """Returns the types of which SOME_EVENTS has every event; none if it is missing or
    unreadable."""
    try:
        named = (pq.read_schema(some).metadata or {}).get(TYPES_KEY, b"").decode()
    except (OSError, pa.ArrowException):
        return []
    return [name for name in named.split(",") if name]


def events_today(table: pd.DataFrame) -> pd.DataFrame:
    """Renames columns and values of older versions in the event table of a result."""
    renamed = table.rename(columns={old: new for old, new in FIELDS.items() if new not in table})
    for column, names in OF_VALUES.items():
        if column in renamed:
            renamed[column] = renamed[column].replace(names)
    return renamed


def read_samples(raw_dir: Path) -> tuple[pd.DataFrame, list[str]]:
    """Reads the samples of a raw folder (samples.jsonl) or of a result (samples.parquet)."""
    if (parquet := raw_dir / "samples.parquet").exists():
        return _read_parquet(parquet, SAMPLE_COLUMNS)
    path = raw_dir / "samples.jsonl"
    if not path.exists():
        return _empty(SAMPLE_COLUMNS), ["samples.jsonl: missing, no CPU and memory figures"]
    rows, problems = read_jsonl(path)
    return frame_of(rows, SAMPLE_COLUMNS), problems


def read_link(raw_dir: Path) -> tuple[pd.DataFrame | None, list[str]]:
    """Reads the link log: link.parquet, or all t_s/series/value files in link/; None without a
    link."""
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
            continue  # other logs and packet captures
        problems += complaints
        part = part.dropna(subset=["t_s", "series"])
        if len(part):
            parts.append(part)
    if not parts:
        return _empty(LINK_COLUMNS), [*problems, "link/: no series found, the RTT is unproven"]
    return pd.concat(parts, ignore_index=True).sort_values("t_s", kind="stable"), problems


def keep_groundtruth(experiment_dir: Path, dataset: str, groundtruth: Path) -> Path:
    """Copies the ground truth to `<experiment>/groundtruth/<dataset>.txt` for later reports and
    for evo. A corrected file replaces an old copy; if the source has gone (an emptied cache),
    the copy stays."""
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
