# SPDX-License-Identifier: Apache-2.0
"""The header of a table of poses: which column is which. Tables of OpenVINS, EuRoC and others
differ in the place of qw and in the unit of time; reading one as the other turns every pose."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from slambed.errors import SlambedError

_TIME = re.compile(
    r"(?:time|timestamps?|t|stamp)(?:_?(s|sec|secs|seconds|ms|msec|us|usec|ns|nsec|nanoseconds))?"
)
_UNIT = re.compile(r"\s*[\[(]\s*([^\])]*?)\s*[\])]")
_UNITS = {
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "milliseconds": "ms",
    "usec": "us", "\u00b5s": "us", "microseconds": "us", "nsec": "ns", "nanoseconds": "ns",
}  # fmt: skip
"""Other words for units."""
_POSITION = re.compile(r"(?:t|p|pos|position|p_rs_r)?_?([xyz])")
_ROTATION = re.compile(r"(?:q|quat|quaternion|orientation|rotation|rot|r|q_rs)_?([xyzw])")
_LENGTH = re.compile(
    r"([^\s,;|\[(]+)\s*[\[(]\s*(mm|cm|km|ft|feet|in|inch|(?:milli|centi|kilo)met(?:er|re)s?)\s*[\])]",
    re.I,
)
"""A column in another unit of length than meters."""
_TITLE = re.compile(r"(?:format|columns|fields|header)\s*:\s*", re.I)
_WANTED = ("time", "x", "y", "z", "qx", "qy", "qz", "qw")


@dataclass(frozen=True)
class PoseColumns:
    """Where a header says that each value of a pose is."""

    order: tuple[int, ...]
    """Columns of time, x, y, z, qx, qy, qz, qw."""
    unit: str | None
    """Unit of time that it names: `s`, `ns` ..."""

    @property
    def count(self) -> int:
        """Number of columns that a row must have at least."""
        return max(self.order) + 1


def named_columns(lines: Sequence[str], where: str) -> PoseColumns | None:
    """Returns the columns that a header above the first row names; None without a header that
    names all eight.

    Raises SlambedError for a file of OpenVINS's states, whose rotation comes first.
    """
    for line in lines:
        words = _words(line)
        if words and not line.lstrip().startswith("#") and not words[0].lstrip("_/")[:1].isalpha():
            return None
        names = [_name(word) for word in words]
        if names[:1] == ["time"] and words[1:3] == ["q", "p"]:
            raise SlambedError(
                f"{where}: states of OpenVINS, rotation first; take its poses "
                "('timestamp(s) tx ty tz qx qy qz qw')"
            )
        if all(names.count(name) == 1 for name in _WANTED):
            _must_be_meters(line, where)
            unit = _unit_of(line, words[0]) if names[0] == "time" else None
            return PoseColumns(tuple(names.index(name) for name in _WANTED), unit)
        unknown = [word for word, name in zip(words, names, strict=True) if name not in _WANTED]
        poses = {"x", "y", "z"} <= {*names} or {"qx", "qy", "qz", "qw"} <= {*names}
        if names[:1] == ["time"] and len(words) >= len(_WANTED) and poses:
            raise SlambedError(
                f"{where}: a header with {', '.join(unknown) or 'a name twice'}, which no pose "
                f"has; expected {' '.join(_WANTED)} in any order"
            )
    return None


def _words(line: str) -> list[str]:
    """Returns the names in a header, which may stand in brackets or quotes, behind a title."""
    names = _UNIT.sub("", _untitled(line))
    return [word.strip("\"'") for word in re.split(r"[\s,;|]+", names) if word]


def _untitled(line: str) -> str:
    text = _TITLE.sub("", line.strip(" \t#\r\n"), count=1)
    return text[1:].rstrip("])") if text[:1] in ("[", "(") else text


def _must_be_meters(line: str, where: str) -> None:
    for word, unit in _LENGTH.findall(line):
        if _name(word.strip("\"'")) in ("x", "y", "z"):
            raise SlambedError(
                f"{where}: the header has {word} in {unit}, expected meters; convert the positions"
            )


def _unit_of(line: str, first: str) -> str | None:
    """Returns the unit of time that a header names, in brackets behind the name of its first
    column, `first`, or as a part of that name."""
    behind = _untitled(line).partition(first)[2].lstrip("\"'")
    found = _UNIT.match(behind) or _TIME.fullmatch(first.lower())
    word = (found.group(1) or "").lower() if found is not None else ""
    return _UNITS.get(word, word) or None


def _name(word: str) -> str:
    # Tables of ROS topics have paths: /pose/position/x, header.stamp.
    parts = word.lower().replace("/", ".").strip("._").split(".")
    lower = "_".join(parts[-2:])
    if parts[-1] == "stamp" or _TIME.fullmatch(lower):
        return "time"
    if (found := _ROTATION.fullmatch(lower)) is not None:
        return f"q{found.group(1)}"
    return found.group(1) if (found := _POSITION.fullmatch(lower)) is not None else lower
