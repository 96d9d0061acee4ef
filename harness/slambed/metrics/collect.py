# SPDX-License-Identifier: Apache-2.0
"""Raw files of a run into the Parquet files of its result (docs/results.md lists every column)."""

import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from slambed.errors import SlambedError
from slambed.metrics.events import Event, EventLog, read_events, read_jsonl

SCHEMA_VERSION = "1"

_F, _I, _S, _B = pa.float64(), pa.int64(), pa.string(), pa.bool_()

EVENT_COLUMNS: dict[str, pa.DataType] = {
    "t_ns": _I, "node": _S, "type": _S, "frame": _I, "seq_s": _F,
    "state": _S, "matches": _I, "inliers": _I, "local_points": _I, "track_ms": _F, "wait_ms": _F,
    "keyframe": _I, "new_points": _I, "need": _S, "reason": _S, "keyframes": _I, "points": _I,
    "update": _I, "newest_keyframe": _I, "gap_keyframes": _I, "relocalisation": _B,
    "t_track_ms": _F, "t_me_ms": _F, "t_rkf_ms": _F, "t_lm_ms": _F, "t_wait_ms": _F,
    "t_plmu_ms": _F, "t_em_ms": _F, "t_mu_ms": _F, "t_total_ms": _F, "pause_ms": _F,
    "incarnation": _I,
    "from": _S, "to": _S, "rtt_ms": _F, "epoch": _I, "source": _S, "channel": _S,
    "name": _S, "worker": _S, "wall_ms": _F, "cpu_ms": _F, "n1": _F, "n2": _F,
    "direction": _S, "message": _S, "bytes": _I, "sequence": _I,
    "queued_ns": _I, "sent_ns": _I, "received_ns": _I, "dropped": _B,
    "event": _S, "detail": _S, "text": _S, "target": _S, "fault": _S,
}  # fmt: skip
SAMPLE_COLUMNS: dict[str, pa.DataType] = {
    "t_s": _F, "node": _S, "cpu_s": _F, "cpu_percent": _F, "memory_mb": _F,
    "throttled_s": _F, "throttled_periods": _I,
    "run_delay_s": _F, "cpu_pressure_s": _F, "host_steal_s": _F,
    "tcp_rtt_ms": _F, "tcp_retransmits": _I,
}  # fmt: skip
LINK_COLUMNS: dict[str, pa.DataType] = {"t_s": _F, "series": _S, "value": _F}

EXTRA_COLUMN = "extra"
"""Fields of an event that the schema does not know, as one JSON object: nothing is lost."""


@dataclass
class Collected:
    """What was written, and what was wrong with the raw files (one line each)."""

    written: list[Path] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)


def to_parquet(raw_dir: Path, out_dir: Path) -> Collected:
    """Writes events.parquet, samples.parquet and, where there was a link, link.parquet.

    Torn or foreign lines are dropped and reported. Raises SlambedError when `out_dir` cannot be
    written.
    """
    result = Collected()
    log = read_events(raw_dir)
    result.problems += log.problems
    samples, complaints = read_samples(raw_dir)
    result.problems += complaints
    link, complaints = read_link(raw_dir)
    result.problems += complaints
    tables = {
        "events.parquet": _table(log.events, EVENT_COLUMNS, result.problems, extra=True),
        "samples.parquet": _table(_records(samples), SAMPLE_COLUMNS, result.problems),
    }
    if link is not None:
        tables["link.parquet"] = _table(_records(link), LINK_COLUMNS, result.problems)
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
        for name, table in tables.items():
            partial = out_dir / f".{name}.partial"
            pq.write_table(table, partial, compression="zstd")
            partial.rename(out_dir / name)
            result.written.append(out_dir / name)
    except OSError as error:
        raise SlambedError(
            f"cannot write results, {out_dir}, {error.strerror}: check space and permissions"
        ) from error
    return result


def read_log(folder: Path) -> EventLog:
    """Events of a raw folder (events.jsonl of the nodes) or of a result (events.parquet)."""
    path = folder / "events.parquet"
    return stored_log(path) if path.exists() else read_events(folder)


def stored_log(path: Path, types: Sequence[str] | None = None) -> EventLog:
    """The events (of these types) of a result, as the nodes wrote them: without nulls, ids whole
    numbers of 64 bits, what the schema does not know unpacked."""
    try:
        table = pq.read_table(path, filters=[("type", "in", list(types))] if types else None)
    except (OSError, pa.ArrowException) as error:
        return EventLog([], [f"{path.name}: unreadable ({str(error).splitlines()[0]})"])
    events: list[Event] = []
    for row in table.to_pylist():
        event = {key: value for key, value in row.items() if value is not None}
        if (extra := event.pop(EXTRA_COLUMN, None)) is not None:
            event |= json.loads(extra)
        events.append(event)
    return EventLog(events)


def read_samples(raw_dir: Path) -> tuple[pd.DataFrame, list[str]]:
    """Samples of a raw folder (samples.jsonl) or of a result (samples.parquet)."""
    if (parquet := raw_dir / "samples.parquet").exists():
        return _read_parquet(parquet, SAMPLE_COLUMNS)
    path = raw_dir / "samples.jsonl"
    if not path.exists():
        return _empty(SAMPLE_COLUMNS), ["samples.jsonl: missing, no CPU and memory figures"]
    rows, problems = read_jsonl(path)
    return _frame(rows, SAMPLE_COLUMNS), problems


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
            part = _frame(rows, LINK_COLUMNS)
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
    partial = target.with_suffix(f".{os.getpid()}.partial")
    shutil.copyfile(groundtruth, partial)
    partial.rename(target)
    return target


def _read_csv(path: Path) -> tuple[pd.DataFrame, list[str]]:
    try:
        table = pd.read_csv(path, on_bad_lines="skip")
    except (OSError, ValueError) as error:
        return _empty(LINK_COLUMNS), [f"{path.name}: unreadable ({error})"]
    if not set(LINK_COLUMNS) <= set(table.columns):
        return _empty(LINK_COLUMNS), []
    return _frame(_records(table), LINK_COLUMNS), []


def _read_parquet(path: Path, columns: dict[str, pa.DataType]) -> tuple[pd.DataFrame, list[str]]:
    try:
        table = pq.read_table(path).to_pandas()
    except (OSError, pa.ArrowException) as error:
        return _empty(columns), [f"{path.name}: unreadable ({str(error).splitlines()[0]})"]
    for name in columns:
        if name not in table:
            table[name] = None
    return pd.DataFrame(table), []


def _records(table: pd.DataFrame | None) -> list[Event]:
    if table is None:
        return []
    return [{str(k): v for k, v in row.items()} for row in table.to_dict("records")]


def _frame(rows: list[Event], columns: dict[str, pa.DataType]) -> pd.DataFrame:
    return pd.DataFrame(_table(rows, columns, []).to_pandas())


def _empty(columns: dict[str, pa.DataType]) -> pd.DataFrame:
    return _frame([], columns)


def _table(
    rows: list[Event], columns: dict[str, pa.DataType], problems: list[str], extra: bool = False
) -> pa.Table:
    """Columns of the schema in its order; a value of the wrong type becomes null and is told."""
    arrays = {}
    for name, kind in columns.items():
        values = [row.get(name) for row in rows]
        good = [_coerce(value, kind) for value in values]
        wrong = sum(
            v is not None and g is None and v == v  # NaN is "not measured", not wrong
            for v, g in zip(values, good, strict=True)
        )
        if wrong:
            problems.append(f"column {name}: {wrong} values of the wrong type, dropped")
        arrays[name] = pa.array(good, kind)
    if extra:
        arrays[EXTRA_COLUMN] = pa.array([_unknown(row, columns) for row in rows], _S)
    table = pa.table(arrays)
    return table.replace_schema_metadata({"slambed_schema": SCHEMA_VERSION})


def _coerce(value: object, kind: pa.DataType) -> object:
    if value is None or value != value:
        return None
    if kind == _B:
        return value if isinstance(value, bool) else None
    if kind == _S:
        return value if isinstance(value, str) else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    if kind == _F:
        return float(value)
    return int(value) if float(value).is_integer() else None


def _unknown(row: Event, columns: dict[str, pa.DataType]) -> str | None:
    rest = {key: value for key, value in row.items() if key not in columns}
    return json.dumps(rest, sort_keys=True) if rest else None
