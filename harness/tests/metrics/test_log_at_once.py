# SPDX-License-Identifier: Apache-2.0
"""Logs are read and converted as a whole: the same result as line by line and row by row."""

import json
import math
import random
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from slambed.metrics.event_columns import EVENT_COLUMNS, EXTRA_COLUMN, table_of
from slambed.metrics.events import parse_line, read_events, read_jsonl
from slambed.older_names import EVENTS

WHOLE = '{"t_ns":1,"type":"stage","name":"extract"}\n{"t_ns":2,"type":"link"}\n'


@pytest.mark.parametrize(
    ("text", "problems"),
    [
        (WHOLE, 0),
        (WHOLE[:-4], 1),  # torn
        (WHOLE[:-1], 0),  # whole, without the last newline
        (WHOLE + '{"a":1},{"b":2}\n', 1),
        (WHOLE + '{"a":{}\n{"b":2}\n', 1),
        (WHOLE + "[1]\n", 1),
        (WHOLE + "{}}\n", 1),
        (WHOLE + "\n\n", 0),
        ("\n" + WHOLE, 0),
        ("", 0),
        (WHOLE + '{"a":NaN}\n', 0),
    ],
)
def test_a_log_is_read_as_line_by_line(tmp_path: Path, text: str, problems: int) -> None:
    path = tmp_path / "events.jsonl"
    path.write_text(text)
    objects, complaints = read_jsonl(path)
    expected = [value for line in text.split("\n") if (value := parse_line(line)) is not None]
    assert repr(objects) == repr(expected)
    assert len(complaints) == problems


def test_a_line_that_is_not_utf8_spoils_no_other(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    path.write_bytes(WHOLE.encode() + b'{"a":"\xff"}\n')
    objects, complaints = read_jsonl(path)
    assert len(objects) == 2 and len(complaints) == 1


def test_former_names_are_found_in_a_log_of_today(tmp_path: Path) -> None:
    (tmp_path / "mobile").mkdir()
    old, new = next(iter(EVENTS.items()))
    lines = [*WHOLE.splitlines(), json.dumps({"t_ns": 3, "type": old})]
    lines.append(json.dumps({"t_ns": 4, "type": "state", "state": ["no", "name"]}))
    (tmp_path / "mobile" / "events.jsonl").write_text("\n".join(lines) + "\n")
    types = [event["type"] for event in read_events(tmp_path).events]
    assert types == ["stage", "link", new, "state"]


def row(random_: random.Random) -> dict[str, Any]:
    values: dict[str, Any] = {
        "t_ns": random_.choice([1, 2**62, 2**70, 1.5, 3.0, None, True]),
        "wall_ms": random_.choice([0.5, 7, None, math.nan, "slow", 2**60 + 1]),
        "type": random_.choice(["stage", "link", None, 5]),
        "relocalization": random_.choice([True, False, None, 1]),
        "own": random_.choice([1, "x", None]),
        "other": [1],
    }
    keys = random_.sample(sorted(values), random_.randint(0, len(values)))
    return {key: values[key] for key in keys}


def test_a_table_has_the_values_of_each_row_in_order() -> None:
    random_ = random.Random(39)
    rows = [row(random_) for _ in range(400)]
    problems: list[str] = []
    table = table_of(rows, EVENT_COLUMNS, problems, extra=True)
    one_by_one = [table_of([each], EVENT_COLUMNS, [], extra=True) for each in rows]
    assert table.equals(pa.concat_tables(one_by_one).combine_chunks())
    extras = [{k: v for k, v in each.items() if k not in EVENT_COLUMNS} for each in rows]
    found = [{} if text is None else json.loads(text) for text in table[EXTRA_COLUMN].to_pylist()]
    assert found == extras
    assert {line.split(":")[0] for line in problems} == {
        "column t_ns", "column wall_ms", "column type", "column relocalization",
    }  # fmt: skip


def test_no_rows_give_an_empty_table_with_all_columns() -> None:
    table = table_of([], EVENT_COLUMNS, [], extra=True)
    assert table.num_rows == 0
    assert table.column_names == [*EVENT_COLUMNS, EXTRA_COLUMN]
