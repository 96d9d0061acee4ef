# SPDX-License-Identifier: Apache-2.0
"""Recorded round trip times (CSV, white-space columns, ping logs) and Mahimahi rate traces."""

import csv
import hashlib
import math
import re
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from slambed.data.places import search_path
from slambed.errors import SlambedError
from slambed.link.curves import Trace
from slambed.native import repository_root
from slambed.suggestion import suggestion

MAHIMAHI_PACKET_BITS = 1500 * 8
_PING_TIME = re.compile(r"icmp_seq=(\d+).*time=([0-9.]+) ms")
_UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


class TraceFile(BaseModel):
    """Where an RTT recording is and how to read it."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    file: str
    """Path: absolute, beside the profile, in netem_profiles/, or in a data folder."""
    sha256: str | None = None
    format: Literal["columns", "ping"] = "columns"
    """`columns`: a header line, then comma or white-space separated numbers; `ping`: its output."""
    time: str = "time_s"
    """Name of the time column."""
    time_unit: Literal["s", "ms", "us", "ns"] = "s"
    rtt: str = "rtt_ms"
    """Name of the RTT column."""
    rtt_unit: Literal["s", "ms", "us", "ns"] = "ms"
    ping_interval_s: float = Field(default=1.0, gt=0)
    start_s: float = Field(default=0.0, ge=0)
    """First second of the recording to use; it becomes run time 0."""
    length_s: float | None = Field(default=None, gt=0)
    max_gap_s: float = Field(default=1.0, gt=0)
    """A longer silence in the recording is an error: it would be invented by interpolation."""
    hold: bool = False


def find_trace(name: str, near: Path | None) -> Path:
    """The file of that name; raises with the places searched."""
    path = Path(name).expanduser()
    if path.is_absolute():
        candidates = [path]
    else:
        folders = [repository_root() / "netem_profiles", *search_path()]
        candidates = [folder / path for folder in ([near] if near else []) + folders]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    places = ", ".join(str(candidate.parent) for candidate in candidates)
    raise SlambedError(f"trace file '{name}' not found, looked in {places}; set SLAMBED_DATA")


def sha256_of(path: Path) -> str:
    """Hex digest of the file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def check_digest(path: Path, expected: str | None) -> None:
    """Raises when the file is not the one the profile was written for."""
    if expected is not None and sha256_of(path) != expected:
        raise SlambedError(f"not the expected content (sha256), {path}; fetch the file again")


def read_rtt_trace(description: TraceFile, near: Path | None) -> Trace:
    """The recording as a curve that begins at run time 0."""
    path = find_trace(description.file, near)
    check_digest(path, description.sha256)
    read = _read_ping if description.format == "ping" else _read_columns
    times, values = read(path, description)
    if len(times) == 0:
        raise SlambedError(f"no samples, {path}; expected {description.format} lines")
    times = times - times[0] - description.start_s
    chosen = times >= 0
    if description.length_s is not None:
        chosen &= times <= description.length_s
    if not chosen.any():
        raise SlambedError(f"no samples between start_s and its end, {path}; correct the window")
    times, values = times[chosen], values[chosen]
    _check(path, times, values, description)
    return Trace(times_s=times, values_ms=values, hold=description.hold)


def _check(path: Path, times: np.ndarray, values: np.ndarray, description: TraceFile) -> None:
    if (bad := np.flatnonzero(~np.isfinite(values))).size:
        raise SlambedError(f"RTT is not a number at {times[bad[0]]:.3f} s, {path}; clean the file")
    if (bad := np.flatnonzero(values < 0)).size:
        place = f"{values[bad[0]]:g} ms at {times[bad[0]]:.3f} s"
        raise SlambedError(f"negative latency {place}, {path}; clean the file")
    steps = np.diff(times)
    if (bad := np.flatnonzero(steps <= 0)).size:
        raise SlambedError(
            f"time does not increase at {times[bad[0]]:.3f} s, {path}; sort the file"
        )
    if (bad := np.flatnonzero(steps > description.max_gap_s)).size:
        start = times[bad[0]] + description.start_s
        raise SlambedError(
            f"gap of {steps[bad[0]]:.1f} s in the trace at {start:.1f} s, {path}; "
            "choose another window (start_s, length_s) or raise max_gap_s"
        )


def _read_columns(path: Path, description: TraceFile) -> tuple[np.ndarray, np.ndarray]:
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = [row for row in _split(lines) if row]
    if len(rows) < 2:
        raise SlambedError(f"no samples, {path}; expected a header line and numbers")
    header = [name.strip() for name in rows[0]]
    places = []
    for name in (description.time, description.rtt):
        if name not in header:
            raise SlambedError(f"no column '{name}', {path}; {suggestion(name, header)}")
        places.append(header.index(name))
    times, values = [], []
    for number, row in enumerate(rows[1:], start=2):
        try:
            times.append(float(row[places[0]]))
            values.append(float(row[places[1]]))
        except (ValueError, IndexError):
            raise SlambedError(f"not two numbers, {path} line {number}; clean the file") from None
        if not math.isfinite(times[-1]):
            raise SlambedError(f"time is not a number, {path} line {number}; clean the file")
    to_ms = _UNITS_S[description.rtt_unit] / _UNITS_S["ms"]
    # Subtracted before scaling: 13-digit epoch milliseconds keep their precision.
    start = times[0] if times else 0.0
    relative = (np.array(times) - start) * _UNITS_S[description.time_unit]
    return relative, np.array(values) * to_ms


def _split(lines: list[str]) -> list[list[str]]:
    written = [line for line in lines if line.strip() and not line.startswith("#")]
    if written and "," in written[0]:
        return list(csv.reader(written))
    return [line.split() for line in written]


def _read_ping(path: Path, description: TraceFile) -> tuple[np.ndarray, np.ndarray]:
    matches = _PING_TIME.finditer(path.read_text(encoding="utf-8", errors="replace"))
    samples = np.array([(int(m[1]), float(m[2])) for m in matches], dtype=float)
    if samples.size == 0:
        return np.array([]), np.array([])
    return samples[:, 0] * description.ping_interval_s, samples[:, 1]


def read_rate_trace(name: str, near: Path | None) -> list[int]:
    """A Mahimahi trace: one delivery opportunity of 1,500 bytes per line, in milliseconds."""
    path = find_trace(name, near)
    opportunities: list[int] = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            time_ms = int(line)
        except ValueError:
            raise SlambedError(
                f"'{line[:20]}' is not a whole number of milliseconds, {path} line {number}"
            ) from None
        if time_ms < (opportunities[-1] if opportunities else 0):
            raise SlambedError(f"time goes back, {path} line {number}; sort the file")
        opportunities.append(time_ms)
    if not opportunities or opportunities[-1] == 0:
        raise SlambedError(f"no delivery opportunities, {path}; give a Mahimahi trace")
    return opportunities


def mean_rate_mbps(opportunities_ms: list[int]) -> float:
    """Mean rate of a Mahimahi trace."""
    return len(opportunities_ms) * MAHIMAHI_PACKET_BITS / opportunities_ms[-1] / 1e3
