# SPDX-License-Identifier: Apache-2.0
"""Text files in any common encoding and with any line ending; tables with or without a header,
separated by blanks, commas or semicolons."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

from slambed.errors import SlambedError
from slambed.files.encodings import decode_text

_DIGITS_OF_A_NAME = 2
_BETWEEN = re.compile(r"[\s,;]+")


def must_be_regular(path: Path) -> None:
    """Raises SlambedError for what is no file, but there: a pipe can be read once, if it ends."""
    if path.exists() and not path.is_file():
        raise SlambedError(f"{path}: a folder, pipe or device, expected a file")


def read_lines(path: Path) -> list[str]:
    """Returns the lines of a text file, without line endings."""
    try:
        must_be_regular(path)
        return decode_text(path.read_bytes(), str(path)).split("\n")
    except OSError as refused:
        raise SlambedError(f"{path}: cannot be read: {refused.strerror}") from refused


def fields(line: str) -> list[str]:
    """Splits at blanks, commas and semicolons; a trailing separator adds no field."""
    return [field for field in _BETWEEN.split(line.split("#", 1)[0]) if field]


def table_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yields number (from 1) and text of each line, without empty lines, comments and a header."""
    header, rows = None, 0
    for number, line in enumerate(read_lines(path), 1):
        words = fields(line)
        if not words:
            continue
        if header is None and not rows and is_header(words):
            header = number, line
            continue
        rows += 1
        yield number, line
    # A first line without rows is no header; the caller reports what is wrong with it.
    if header is not None and not rows:
        yield header


def is_header(words: list[str]) -> bool:
    """Returns True for column names such as `timestamp` or `r11`, but not for a mistyped time."""
    name = words[0].strip("\"'/[(")
    begins = re.match(r"[^\W\d]", name) is not None and not _is_number(name)
    return begins and sum(letter.isdecimal() for letter in name) <= _DIGITS_OF_A_NAME


def pose_rows(
    path: Path, columns: int, expected: str, *, longer: bool = False
) -> list[tuple[int, list[float]]]:
    """Returns line number and values of each row of a table of poses, all finite; with `longer`
    extra columns are ignored."""
    rows = []
    for number, line in table_lines(path):
        words = fields(line)
        if len(words) < columns or (len(words) > columns and not longer):
            raise _no_pose(f"{path}:{number}", f"{len(words)} values", expected)
        values = [_number(word, path, number, expected) for word in words[:columns]]
        rows.append((number, values))
    return rows


def _number(word: str, path: Path, line: int, expected: str) -> float:
    value = float(word) if _is_number(word) else math.nan
    if not math.isfinite(value):
        raise _no_pose(f"{path}:{line}", f"'{word}' is not a number", expected)
    return value


def _no_pose(place: str, found: str, expected: str) -> SlambedError:
    return SlambedError(
        f"{place}: not a pose: {found}, expected {expected}; correct or remove the line"
    )


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
