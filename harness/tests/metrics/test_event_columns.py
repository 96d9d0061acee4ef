# SPDX-License-Identifier: Apache-2.0
"""Rows are converted to columns of a fixed schema; values of wrong types are reported."""

import json
import math
from typing import Any

import pytest

from slambed.metrics.event_columns import (
    EVENT_COLUMNS,
    EXTRA_COLUMN,
    SAMPLE_COLUMNS,
    frame_of,
    table_of,
    table_of_frame,
)


def stored(values: list[Any], column: str) -> tuple[list[Any], list[str]]:
    """Returns what an event column keeps of these values, and what is reported."""
    problems: list[str] = []
    rows = [{"t_ns": number, column: value} for number, value in enumerate(values)]
    kept = table_of(rows, EVENT_COLUMNS, problems, extra=True).column(column).to_pylist()
    return kept, problems


@pytest.mark.parametrize(
    ("column", "values", "kept"),
    [
        ("track_ms", [1, 2.5, None, math.nan], [1.0, 2.5, None, None]),
        ("track_ms", [2**60 + 1, 0.5], [float(2**60 + 1), 0.5]),
        ("frame", [3, None, 7.0, (1 << 56) + 1], [3, None, 7, (1 << 56) + 1]),
        ("state", ["ok", None], ["ok", None]),
        ("dropped", [True, None, False], [True, None, False]),
    ],
)
def test_values_that_fit_are_kept(column: str, values: list[Any], kept: list[Any]) -> None:
    assert stored(values, column) == (kept, [])


@pytest.mark.parametrize(
    ("column", "values", "kept"),
    [
        ("track_ms", [1.5, "fast", True, 10**400], [1.5, None, None, None]),
        ("frame", [1, 1.5, 2**70], [1, None, None]),
        ("state", ["ok", 3], ["ok", None]),
        ("dropped", [True, 1], [True, None]),
    ],
)
def test_values_that_do_not_fit_are_reported(
    column: str, values: list[Any], kept: list[Any]
) -> None:
    found, problems = stored(values, column)
    wrong = sum(value is None for value in kept)
    assert found == kept
    assert problems == [f"column {column}: {wrong} values of the wrong type, dropped"]


def test_what_the_schema_does_not_know_is_kept_as_json() -> None:
    rows = [{"t_ns": 1, "odd": [1, 2], "also": None}, {"t_ns": 2}]
    table = table_of(rows, EVENT_COLUMNS, [], extra=True)
    assert table.column_names == [*EVENT_COLUMNS, EXTRA_COLUMN]
    assert table.column(EXTRA_COLUMN).to_pylist() == ['{"also": null, "odd": [1, 2]}', None]
    assert table_of(rows, EVENT_COLUMNS, []).column_names == list(EVENT_COLUMNS)


def test_a_frame_is_stored_as_its_rows_are() -> None:
    rows = [
        {"t_s": 0.0, "node": "mobile", "cpu_s": 1, "throttled_periods": 3},
        {"t_s": 0.1, "node": "edge", "memory_mb": 2.5},
        {"t_s": 0.2},
    ]
    frame = frame_of(json.loads(json.dumps(rows)), SAMPLE_COLUMNS)
    reported: list[str] = []
    assert table_of_frame(frame, SAMPLE_COLUMNS, reported).equals(
        table_of(rows, SAMPLE_COLUMNS, [])
    )
    strange = frame.assign(cpu_s=["1", 2.0, None])
    table = table_of_frame(strange, SAMPLE_COLUMNS, reported)
    assert table.column("cpu_s").to_pylist() == [None, 2.0, None]
    assert reported == ["column cpu_s: 1 values of the wrong type, dropped"]
