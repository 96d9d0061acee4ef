# SPDX-License-Identifier: Apache-2.0
"""Converts events, samples and link series to columns of a fixed schema
(docs/reference/parquet.md)."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from slambed.metrics.events import Event

SCHEMA_VERSION = "1"

_F, _I, _S, _B = pa.float64(), pa.int64(), pa.string(), pa.bool_()

Columns = dict[str, pa.DataType]

EVENT_COLUMNS: Columns = {
    "t_ns": _I, "node": _S, "type": _S, "frame": _I, "seq_s": _F,
    "state": _S, "matches": _I, "inliers": _I, "local_points": _I, "track_ms": _F, "wait_ms": _F,
    "keyframe": _I, "new_points": _I, "need": _S, "reason": _S, "keyframes": _I, "points": _I,
    "update": _I, "newest_keyframe": _I, "gap_keyframes": _I, "relocalization": _B,
    "t_track_ms": _F, "t_me_ms": _F, "t_rkf_ms": _F, "t_lm_ms": _F, "t_wait_ms": _F,
    "t_plmu_ms": _F, "t_em_ms": _F, "t_mu_ms": _F, "t_total_ms": _F, "pause_ms": _F,
    "session": _I,
    "from": _S, "to": _S, "rtt_ms": _F, "epoch": _I, "source": _S, "channel": _S,
    "name": _S, "worker": _S, "wall_ms": _F, "cpu_ms": _F, "n1": _F, "n2": _F,
    "direction": _S, "message": _S, "bytes": _I, "sequence": _I,
    "queued_ns": _I, "sent_ns": _I, "received_ns": _I, "dropped": _B,
    "event": _S, "detail": _S, "text": _S, "target": _S, "fault": _S,
}  # fmt: skip
SAMPLE_COLUMNS: Columns = {
    "t_s": _F, "node": _S, "cpu_s": _F, "cpu_percent": _F, "memory_mb": _F,
    "throttled_s": _F, "throttled_periods": _I,
    "run_delay_s": _F, "cpu_pressure_s": _F, "host_steal_s": _F,
    "tcp_rtt_ms": _F, "tcp_retransmits": _I,
}  # fmt: skip
LINK_COLUMNS: Columns = {"t_s": _F, "series": _S, "value": _F}

EXTRA_COLUMN = "extra"
"""Event fields outside the schema, as one JSON object, so that no data is lost."""

LARGEST = (1 << 63) - 1

_FITTING: dict[pa.DataType, frozenset[type]] = {
    _F: frozenset({float, int, type(None)}),
    _I: frozenset({int, type(None)}),
    _S: frozenset({str, type(None)}),
    _B: frozenset({bool, type(None)}),
}
"""Types that Arrow accepts without conversion."""
_PLAIN: dict[pa.DataType, type] = {_F: float, _I: int}
"""Types whose values alone make a NumPy array of the same numbers."""


def table_of(
    rows: Sequence[Event], columns: Columns, problems: list[str], extra: bool = False
) -> pa.Table:
    """Returns the columns of the schema in order; values of a wrong type become null and are
    reported."""
    # Rows of one event type have the same keys, so each such group is converted column by column.
    places: dict[tuple[str, ...], list[int]] = {}
    for index, row in enumerate(rows):
        places.setdefault(tuple(row), []).append(index)
    groups = [_Group.of(keys, [rows[index] for index in own]) for keys, own in places.items()]
    order = np.empty(len(rows), dtype=np.int64)
    order[list(chain.from_iterable(places.values()))] = np.arange(len(rows))
    back = pa.array(order)
    used = set(chain.from_iterable(places))
    arrays = {
        name: _column(name, groups, kind, problems).take(back)
        if name in used
        else pa.nulls(len(rows), kind)
        for name, kind in columns.items()
    }
    if extra:
        arrays[EXTRA_COLUMN] = pa.array(
            [text for group in groups for text in group.further(columns)], _S
        ).take(back)
    return pa.table(arrays).replace_schema_metadata({"slambed_schema": SCHEMA_VERSION})


@dataclass(frozen=True)
class _Group:
    """The rows with the same keys: their number, and the values of each key."""

    size: int
    values: dict[str, tuple[object, ...]]

    @classmethod
    def of(cls, keys: tuple[str, ...], rows: list[Event]) -> "_Group":
        """Returns the group of rows that all have these keys in this order."""
        values = zip(*map(dict.values, rows), strict=True)
        return cls(len(rows), dict(zip(keys, values, strict=True)))

    def further(self, columns: Columns) -> list[str | None]:
        """Returns the fields of each row that are no columns, as JSON; None without any."""
        names = [key for key in self.values if key not in columns]
        if not names:
            return [None] * self.size
        rows = zip(*(self.values[name] for name in names), strict=True)
        return [json.dumps(dict(zip(names, row, strict=True)), sort_keys=True) for row in rows]


def _column(name: str, groups: list[_Group], kind: pa.DataType, problems: list[str]) -> pa.Array:
    """Returns one column of all groups, one after the other."""
    parts = []
    gap = 0
    try:
        for group in groups:
            values = group.values.get(name)
            if values is None:
                gap += group.size
                continue
            types = set(map(type, values))
            if not types <= _FITTING[kind]:
                break
            if gap:
                parts.append(pa.nulls(gap, kind))
                gap = 0
            # NumPy reads plain numbers quicker than Arrow does, which then takes them as they are.
            plain: Any = np.array(values, _PLAIN[kind]) if types == {_PLAIN.get(kind)} else values
            parts.append(pa.array(plain, kind, from_pandas=kind == _F))
        else:
            return pa.concat_arrays([*parts, pa.nulls(gap, kind)])
    except (OverflowError, pa.ArrowException):
        pass  # a number out of range, handled below
    nothing = [(None,) * group.size for group in groups]
    return _coerced(
        name,
        [v for g, none in zip(groups, nothing, strict=True) for v in g.values.get(name, none)],
        kind,
        problems,
    )


def table_of_frame(frame: pd.DataFrame, columns: Columns, problems: list[str]) -> pa.Table:
    """Converts a data frame likewise."""
    schema = pa.schema(list(columns.items()))
    try:
        table = pa.Table.from_pandas(frame[list(columns)], schema, preserve_index=False)
    except (KeyError, pa.ArrowException):
        rows = [{str(k): v for k, v in row.items()} for row in frame.to_dict("records")]
        return table_of(rows, columns, problems)
    return table.replace_schema_metadata({"slambed_schema": SCHEMA_VERSION})


def frame_of(rows: Sequence[Event], columns: Columns) -> pd.DataFrame:
    """Returns rows as a data frame of the schema; values of a wrong type become null."""
    return pd.DataFrame(table_of(rows, columns, []).to_pandas())


def _coerced(name: str, values: list[object], kind: pa.DataType, problems: list[str]) -> pa.Array:
    """Returns the values of the right type; the others become null and are reported."""
    good = [_coerce(value, kind) for value in values]
    if wrong := _count_wrong(values, good):
        problems.append(f"column {name}: {wrong} values of the wrong type, dropped")
    return pa.array(good, kind)


def _count_wrong(values: Iterable[object], good: Iterable[object]) -> int:
    """NaN means "not measured" and is not counted as wrong."""
    pairs = zip(values, good, strict=True)
    return sum(v is not None and g is None and v == v for v, g in pairs)


def _coerce(value: object, kind: pa.DataType) -> object:
    if value is None or value != value:
        return None
    if kind == _B:
        return value if isinstance(value, bool) else None
    if kind == _S:
        return value if isinstance(value, str) else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    if kind == _F:
        return number
    return int(value) if number.is_integer() and -LARGEST <= value <= LARGEST else None
