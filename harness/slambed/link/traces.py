# SPDX-License-Identifier: Apache-2.0
"""Reads recorded RTTs (CSV, whitespace-separated columns, ping logs) and Mahimahi rate traces."""

import csv
import hashlib
import math
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from slambed.data.places import search_path
from slambed.data.text_file import read_lines
from slambed.errors import SlambedError
from slambed.files.outputs import at_home, is_file
from slambed.link.curves import Trace
from slambed.link.ping import read_ping
from slambed.native import repository_root
from slambed.spec.run_spec import with_trace_names
from slambed.suggestion import suggestion

MAHIMAHI_PACKET_BITS = 1500 * 8
_LONGEST_RATE_MS = 10**9
_LATEST_START_MS = 3_600_000
"""A trace that begins later counts from another time than its own start."""
_MAX_GAP_S = 1.0
_PING_INTERVAL_S = 1.0
"""Default of ping on every system."""
_UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


_WORD_OF_NAME = re.compile(r"[^\W\d_]+?(?=[\W\d_]|$|(?<=[a-z])[A-Z])")
_UNITS_OF_NAMES = {
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "msecs", "millis", "millisecond", "milliseconds"),
    "us": ("us", "µs", "μs", "usec", "usecs", "micros", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nsecs", "nanos", "nanosecond", "nanoseconds"),
}
"""Unit -> last word of the name of a column in it: `rtt_us`, `rtt (µs)`, `rttSec`."""
_SHORTEST_STEP_S = 1e-5
"""Nobody measures RTTs more often."""
_SAME_TIME_S = 1e-3
"""A window that begins or ends so near a sample is meant to do so there."""
_SHORTEST_RTT_MS = 0.1
"""Shorter round trips leave no machine; a trace in seconds has them."""
MOST_OUTAGES = 4
"""Gaps of a trace that an error writes as outages."""
_SEPARATOR_LINE = re.compile(r"sep=(.)", re.I)
_WORD = re.compile(r'"[^"]*"|\S+')


class TraceFile(BaseModel):
    """Location and format of an RTT recording."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    file: str
    """Path: absolute, or relative to the profile's folder, netem_profiles/ or a data folder."""
    sha256: str | None = None
    """Digest of the file; another content is an error."""
    format: Literal["columns", "ping"] = "columns"
    """`columns`: a header line, then comma- or whitespace-separated numbers; `ping`: output of
    ping."""
    time: str = "time_s"
    """Name of the time column, of numbers or of dates (2026-11-26T17:15:30.250Z)."""
    time_unit: Literal["s", "ms", "us", "ns"] = "s"
    """Unit of the time column, where it has numbers."""
    rtt: str = "rtt_ms"
    """Name of the RTT column."""
    rtt_unit: Literal["s", "ms", "us", "ns"] = "ms"
    """Unit of the RTT column."""
    ping_interval_s: float | None = Field(default=None, gt=0)
    """Time between two requests; null: 1 s, which is said. Ignored for a log with the timestamps of
    `-D`."""
    start_s: float = Field(default=0.0, ge=0)
    """Offset into the recording that becomes run time 0."""
    length_s: float | None = Field(default=None, gt=0)
    """How much of the recording is used; null: all."""
    max_gap_s: float | None = Field(default=None, gt=0)
    """A longer gap in the recording is an error because interpolation would invent values.
    Default 1 s; for a ping log at least 2.5 intervals, so that one reply may be lost."""
    hold: bool = False
    """True: each value holds until the next one; false: straight lines between."""

    @model_validator(mode="after")
    def _has_keys_of_its_format(self) -> "TraceFile":
        of_columns = {"time", "time_unit", "rtt", "rtt_unit"}
        others = of_columns if self.format == "ping" else {"ping_interval_s"}
        if others := others & self.model_fields_set:
            raise ValueError(f"{min(others)} means nothing with format: {self.format}; remove it")
        return self


def find_trace(name: str, near: Path | None) -> Path:
    """Returns the path of a trace file. Raises SlambedError with the places searched."""
    path = at_home(name)
    if path.is_absolute():
        candidates = [path]
    else:
        folders = [repository_root() / "netem_profiles", *search_path()]
        candidates = [folder / path for folder in ([near] if near else []) + folders]
    for candidate in candidates:
        if is_file(candidate):
            return candidate
    places = ", ".join(str(candidate.parent) for candidate in candidates)
    raise SlambedError(f"trace file '{name}' not found, looked in {places}; set SLAMBED_DATA")


def sha256_of(path: Path) -> str:
    """Returns the hex digest of the file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def check_digest(path: Path, expected: str | None) -> None:
    """Raises SlambedError when the file differs from the one that the profile was written for."""
    if expected is not None and sha256_of(path) != expected:
        raise SlambedError(f"not the expected content (sha256), {path}; fetch the file again")


def lasting_name(name: str, near: Path | None) -> str:
    """Returns a name by which the trace is found without `near` too: its path where only the folder
    of the profile leads to it, and otherwise `name`."""
    path = find_trace(name, near)
    try:
        elsewhere = find_trace(name, None)
    except SlambedError:
        return str(path.resolve())
    return name if elsewhere.resolve() == path.resolve() else str(path.resolve())


def at_full_paths(content: Mapping[str, Any]) -> tuple[dict[str, Any], list[Path]]:
    """Returns a profile's content that names its traces by absolute paths, and those files: for a
    process that has other data folders. Raises SlambedError when a trace is not found."""
    files: list[Path] = []

    def full(name: str) -> str:
        files.append(find_trace(name, None).resolve())
        return str(files[-1])

    replaced = with_trace_names(content, full)
    return replaced, list(dict.fromkeys(files))


@dataclass(frozen=True)
class Silence:
    """A time in which nothing was recorded and across which the curve leads."""

    begin_s: float
    """Run time."""
    end_s: float
    remark: str

    def later(self, by_s: float) -> "Silence":
        """Returns the same silence of a recording that begins `by_s` later."""
        return replace(self, begin_s=self.begin_s + by_s, end_s=self.end_s + by_s)


@dataclass(frozen=True)
class RttTrace:
    """A recording as a curve that begins at run time 0, and what to know about it."""

    curve: Trace
    remarks: tuple[str, ...]
    """What was assumed, a line each."""
    silence: Silence | None
    """The first one that `max_gap_s` allows."""


def read_rtt_trace(description: TraceFile, near: Path | None) -> RttTrace:
    """Reads the file that `description` names, by its path or in the folder `near`."""
    path = find_trace(description.file, near)
    check_digest(path, description.sha256)
    remarks: list[str] = []
    if description.format == "ping":
        times, values, assumed = _read_ping(path, description)
        remarks += assumed
    else:
        times, values = _read_columns(path, description)
    if len(times) == 0:
        raise SlambedError(f"no samples, {path}; expected {description.format} lines")
    times = times - times[0]
    if (back := np.flatnonzero(times < 0)).size:
        raise SlambedError(
            f"time goes back to {-times[back[0]]:g} s before the first sample, {path}; was the "
            "clock set? Sort the file, or cut it there"
        )
    times = times - description.start_s
    times, values = _from_zero(times, values, description)
    if description.length_s is not None and times[-1] < description.length_s:
        remarks.append(
            f"{path.name} lasts {times[-1]:g} s from start_s on, of the {description.length_s:g} s "
            "asked for; its last value holds"
        )
    chosen = times >= 0
    if description.length_s is not None:
        chosen &= times <= description.length_s
    if not chosen.any():
        raise SlambedError(f"no samples between start_s and its end, {path}; correct the window")
    recorded_s = times
    times, values = times[chosen], values[chosen]
    _check(path, times, values, description)
    _check_ends(path, times, recorded_s, description)
    if 0 < (middle := float(np.median(values))) < _SHORTEST_RTT_MS:
        remarks.append(
            f"{path.name}: its RTT is {middle:.2g} ms in the median; give rtt_unit if the column "
            "has another unit"
        )
    curve = Trace(times_s=times, values_ms=values, hold=description.hold)
    return RttTrace(curve, tuple(remarks), _silence(path.name, times, description))


def _from_zero(
    times: np.ndarray, values: np.ndarray, description: TraceFile
) -> tuple[np.ndarray, np.ndarray]:
    """Adds the value at time 0 where that is between two samples that are near each other."""
    after = int(np.searchsorted(times, 0.0))
    steps = np.diff(times)
    if not 0 < after < len(times) or times[after] == 0 or not (steps > 0).all():
        return times, values
    if steps[after - 1] > _longest_gap_s(steps, description):
        return times, values
    value = values[after - 1] if description.hold else np.interp(0.0, times, values)
    return np.insert(times, after, 0.0), np.insert(values, after, value)


def _check(path: Path, times: np.ndarray, values: np.ndarray, description: TraceFile) -> None:
    if (bad := np.flatnonzero(values < 0)).size:
        place = f"{values[bad[0]]:g} ms at {times[bad[0]]:.3f} s"
        raise SlambedError(f"negative latency {place}, {path}; clean the file")
    steps = np.diff(times)
    if (bad := np.flatnonzero(steps <= 0)).size:
        at, step = times[bad[0]], steps[bad[0]]
        found = "two samples have the same time" if step == 0 else f"time goes back by {-step:g} s"
        advice = "sort the file or remove the line"
        if 2 * np.count_nonzero(steps == 0) > len(steps):
            advice = "most samples share one; give times with decimals"
        raise SlambedError(f"{found} at {at:.3f} s, {path}; {advice}")
    if steps.size and (usual := float(np.median(steps))) < _SHORTEST_STEP_S:
        raise SlambedError(
            f"samples are {usual:g} s apart by time_unit ({description.time_unit}), {path}; "
            "correct it, and write days of a spreadsheet in seconds"
        )
    longest_s = _longest_gap_s(steps, description)
    if (bad := np.flatnonzero(steps > longest_s)).size:
        start = times[bad[0]] + description.start_s
        is_ping = description.format == "ping"
        unit = "ping_interval_s" if is_ping else f"time_unit ({description.time_unit})"
        if float(np.min(steps)) > longest_s:
            raise SlambedError(
                f"samples are {np.median(steps):g} s apart, {path}; correct {unit}, or raise "
                f"max_gap_s ({longest_s:g} s) if that is true"
            )
        raise SlambedError(
            f"gap of {steps[bad[0]]:.1f} s in the trace at {start:.1f} s, longer than "
            f"{longest_s:g} s, {path}; was it an outage? Write {_as_outages(times, steps, bad)} "
            f"Else choose another window (start_s, length_s), or correct {unit}"
        )


def _check_ends(
    path: Path, times: np.ndarray, recorded_s: np.ndarray, description: TraceFile
) -> None:
    """Raises SlambedError for a window that begins or ends in a gap: the value from beyond the gap
    would hold in it. `recorded_s` has also the times outside the window."""
    longest_s = _longest_gap_s(np.diff(recorded_s), description)
    before, after = recorded_s[recorded_s < times[0]], recorded_s[recorded_s > times[-1]]
    gap_s = times[0] - before.max(initial=-np.inf)
    if before.size and times[0] > _SAME_TIME_S and gap_s > longest_s:
        sample = _in_yaml(times[0] + description.start_s)
        raise SlambedError(f"start_s is in a gap of {gap_s:.1f} s, {path}; move it to {sample}")
    end_s = description.length_s
    gap_s = after.min(initial=np.inf) - times[-1]
    if end_s is not None and after.size and end_s - times[-1] > _SAME_TIME_S and gap_s > longest_s:
        sample = _in_yaml(times[-1])
        raise SlambedError(
            f"length_s ends in a gap of {gap_s:.1f} s, {path}; shorten it to {sample}"
        )


def _silence(name: str, times: np.ndarray, description: TraceFile) -> Silence | None:
    """Returns the first silence that `max_gap_s` allows, if there is one."""
    steps = np.diff(times)
    silences = np.flatnonzero(steps > _usual_gap_s(steps, description))
    if not silences.size:
        return None
    at = silences[0]
    across = "its value holds" if description.hold else "a straight line leads across"
    return Silence(
        float(times[at]),
        float(times[at + 1]),
        f"{name}: nothing was recorded for {steps[at]:.2g} s from {times[at]:.3g} s on (run time), "
        f"which max_gap_s allows; {across}, and an outage goes under gaps",
    )


def _in_yaml(time_s: float) -> str:
    """Returns seconds as YAML has them, exact to a millisecond however late they are."""
    return f"{round(float(time_s), 3):.10g}"


def _as_outages(times: np.ndarray, steps: np.ndarray, gaps: np.ndarray) -> str:
    """Returns the keys with which gaps between samples are outages. The link went down somewhere
    in the interval after the last sample and came back in the one before the next: halves."""
    usual = float(np.median(steps))
    outages = [
        f"{{start_s: {_in_yaml(times[i] + usual / 2)}, length_s: {_in_yaml(steps[i] - usual)}}}"
        for i in gaps[:MOST_OUTAGES]
    ]
    more = f" and {len(gaps) - MOST_OUTAGES} more" if len(gaps) > MOST_OUTAGES else ""
    allowed = np.ceil(10 * steps[gaps].max()) / 10
    return (
        f"'max_gap_s: {allowed:g}' under trace and 'gaps: [{', '.join(outages)}]'{more} (run time) "
        "with 'gap_mode: drop' beside rtt_ms."
    )


def _longest_gap_s(steps: np.ndarray, description: TraceFile) -> float:
    if description.max_gap_s is not None:
        return description.max_gap_s
    return _usual_gap_s(steps, description)


def _usual_gap_s(steps: np.ndarray, description: TraceFile) -> float:
    if description.format != "ping" or not steps.size:
        return _MAX_GAP_S
    # Tolerates jitter of send times and timestamps.
    return max(_MAX_GAP_S, 2.5 * float(np.median(steps)))


def _read_columns(path: Path, description: TraceFile) -> tuple[np.ndarray, np.ndarray]:
    lines = read_lines(path)
    try:
        rows = _split(_with_header(lines, {description.time, description.rtt}))
    except csv.Error as error:
        raise SlambedError(f"no table: {error}, {path}; clean the file") from None
    if len(rows) < 2:
        raise SlambedError(f"no samples, {path}; expected a header line and numbers")
    header = [name.strip() for name in rows[0][1]]
    places = []
    for name, unit_key in ((description.time, "time_unit"), (description.rtt, "rtt_unit")):
        if name not in header:
            advice = suggestion(name, header)
            if all(map(_is_number, header)):
                names = f"{description.time},{description.rtt}"
                advice = f"the first line has no names; write '{names}' above it"
            with suppress(ValueError):
                if read_ping(lines).echoes:
                    advice = "is it a log of ping? Say 'format: ping'"
            raise SlambedError(f"no column '{name}', {path}; {advice}")
        _check_unit(name, unit_key, description, path)
        if header.count(name) > 1:
            raise SlambedError(f"column '{name}' is there twice, {path}; rename one of them")
        places.append(header.index(name))
    times, values = [], []
    for number, row in rows[1:]:
        if len(row) > len(header) and any(cell.strip() for cell in row[len(header) :]):
            raise SlambedError(
                f"{len(row)} cells under {len(header)} names, {path} line {number}; expected one "
                "for each, and decimals with a point"
            )
        try:
            times.append(_time_of(row[places[0]], description.time_unit))
            values.append(float(row[places[1]]))
        except (ValueError, IndexError):
            found = ", ".join(row)[:60]
            raise SlambedError(
                f"not a time and a number but '{found}', {path} line {number}; correct or remove "
                "the line (decimals have a point, times are numbers or dates such as "
                "2026-11-26T17:15:30.250Z)"
            ) from None
        for what, value in (("time", times[-1]), ("RTT", values[-1])):
            if not math.isfinite(value):
                raise SlambedError(f"{what} is not a number, {path} line {number}; clean the file")
    to_ms = _UNITS_S[description.rtt_unit] / _UNITS_S["ms"]
    # Subtracted before scaling: epoch milliseconds with 13 digits keep their precision.
    start = times[0] if times else 0.0
    relative = (np.array(times) - start) * _UNITS_S[description.time_unit]
    return relative, np.array(values) * to_ms


def _check_unit(name: str, key: str, description: TraceFile, path: Path) -> None:
    """Raises SlambedError for a column whose name has another unit than the default, if the profile
    does not say the unit."""
    named = _unit_of(name)
    unit = str(getattr(description, key))
    if named is not None and named != unit and key not in description.model_fields_set:
        raise SlambedError(
            f"column '{name}' is in {named} by its name, and {key} is {unit}, {path}; say "
            f"'{key}: {named}', or '{key}: {unit}' if the name is wrong"
        )


def _unit_of(name: str) -> str | None:
    """Returns the unit that the last word of a column's name says."""
    words = _WORD_OF_NAME.findall(name)
    if len(words) < 2:
        return None
    last = words[-1].lower()
    return next((unit for unit, called in _UNITS_OF_NAMES.items() if last in called), None)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _time_of(text: str, unit: str) -> float:
    """Returns a time in this unit; a date (2026-11-26T17:15:30.250Z) counts from 1970, and is UTC
    where it does not say otherwise. Raises ValueError."""
    try:
        return float(text)
    except ValueError:
        moment = datetime.fromisoformat(text.strip())
        return moment.replace(tzinfo=moment.tzinfo or UTC).timestamp() / _UNITS_S[unit]


def _with_header(lines: list[str], names: set[str]) -> list[str]:
    """Returns the lines with a header that was written as a comment, `# time_s,rtt_ms`, as a line
    of its own: the last one before the first row, if the first row is not the header."""
    first = next((n for n, line in enumerate(lines) if line.strip() and line[0] != "#"), len(lines))
    for n in range(first, -1, -1):
        text = lines[n].lstrip("# \t") if n < len(lines) else ""
        if names <= {word.strip() for word in re.split(r"[,;\s]+", text)}:
            return [*lines[:n], text, *lines[n + 1 :]]
    return lines


def _split(lines: list[str]) -> list[tuple[int, list[str]]]:
    """Returns number (from 1) and fields of each non-empty line."""
    written = [(n, line) for n, line in enumerate(lines, 1) if line.strip() and line[0] != "#"]
    separators = [";", ",", "\t"]
    if written and (asked := _SEPARATOR_LINE.fullmatch(written[0][1].strip())) is not None:
        separators.insert(0, asked[1])  # Excel's first line, which may be that of another file
        del written[0]
    separators = [mark for mark in separators if written and mark in written[0][1]]
    if not separators:
        return [(n, [word.strip('"') for word in _WORD.findall(line)]) for n, line in written]
    rows = [(n, row) for n, line in written for row in csv.reader([line], delimiter=separators[0])]
    if separators[0] == ",":
        return rows
    # Spreadsheets with decimal commas.
    return [(n, [cell.replace(",", ".") for cell in row]) for n, row in rows]


def _read_ping(path: Path, description: TraceFile) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Returns times in s, RTTs in ms, and what was assumed, a line each."""
    try:
        log = read_ping(read_lines(path))
    except ValueError as unusable:
        raise SlambedError(f"{unusable}, {path}; correct it, or give the log of one ping") from None
    start = log.echoes[0].sent if log.echoes else 0.0
    # Subtracted before scaling, as above.
    sent = np.array([echo.sent - start for echo in log.echoes])
    if log.unread and description.ping_interval_s is None:
        raise SlambedError(
            f"{log.unread}, {path}; give ping_interval_s, the time between two requests"
        )
    step_s = 1.0 if log.is_stamped else description.ping_interval_s or _PING_INTERVAL_S
    assumed = []
    if log.echoes and not log.is_stamped and description.ping_interval_s is None:
        assumed.append(
            f"{path.name} has no time stamps, so its requests count as {step_s:g} s apart; give "
            "ping_interval_s if that is wrong"
        )
    return sent * step_s, np.array([echo.rtt_ms for echo in log.echoes]), assumed


def read_rate_trace(name: str, near: Path | None) -> list[int]:
    """Reads a Mahimahi trace: one delivery opportunity of 1,500 bytes per line, in milliseconds."""
    path = find_trace(name, near)
    opportunities: list[int] = []
    for number, line in enumerate(read_lines(path), start=1):
        if not line.strip():
            continue
        try:
            time_ms = int(line)
        except ValueError:
            raise SlambedError(
                f"'{line[:20]}' is not a whole number of milliseconds, {path} line {number}"
            ) from None
        if time_ms > _LONGEST_RATE_MS:
            raise SlambedError(
                f"'{line[:20]}' is more than {_LONGEST_RATE_MS} ms, {path} line {number}; give "
                "milliseconds from the start of the trace"
            )
        if not opportunities and time_ms > _LATEST_START_MS:
            raise SlambedError(
                f"the first packet is at {time_ms / 1e3:g} s, {path} line {number}; give "
                "milliseconds from the start of the trace"
            )
        if time_ms < (opportunities[-1] if opportunities else 0):
            raise SlambedError(f"time goes back, {path} line {number}; sort the file")
        opportunities.append(time_ms)
    if not opportunities or opportunities[-1] == 0:
        raise SlambedError(f"no delivery opportunities, {path}; give a Mahimahi trace")
    return opportunities


def mean_rate_mbps(opportunities_ms: list[int]) -> float:
    """Returns the mean rate of a Mahimahi trace."""
    return len(opportunities_ms) * MAHIMAHI_PACKET_BITS / opportunities_ms[-1] / 1e3
