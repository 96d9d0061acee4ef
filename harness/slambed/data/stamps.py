# SPDX-License-Identifier: Apache-2.0
"""Timestamps of recorded frames: detects their unit and checks their plausibility."""

from __future__ import annotations

import re
import statistics
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from decimal import Decimal, InvalidOperation
from itertools import pairwise

from slambed.errors import SlambedError

NS_PER = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
UNIT_NAMES = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
#: Recordings are from 1990 to 2100: a time since 1970 in this range of seconds reveals its unit.
_EPOCH_S = (631_152_000, 4_102_444_800)
#: A frame rate that differs from the nominal one by this factor indicates a wrong unit.
_RATE_FACTOR = 100
#: A gap longer than both this time and this number of usual steps is a clock jump.
_GAP_S, _GAP_STEPS, _LONGEST_GAP_S = 60.0, 100, 86_400.0
LARGEST_NS = 2**63 - 1
_DIGITS = 19
#: Frame -> where its time is written, for complaints.
Place = Callable[[int], str]


def number_or_date(text: str) -> Decimal:
    """Parses a number, or a date as in KITTI's raw recordings as seconds since 1970; it is UTC
    where it does not say otherwise.

    Raises ValueError.
    """
    try:
        value = Decimal(text)
    except InvalidOperation:
        return _date(text)
    # Its exponent is asked first: comparing 1e99999999 overflows.
    if not value.is_finite() or value.adjusted() > _DIGITS or abs(value) > LARGEST_NS:
        raise ValueError(f"'{text}' is not a time")
    return value


def _date(text: str) -> Decimal:
    # datetime has microseconds only, and recordings have nanoseconds.
    whole, _, rest = re.sub(r"(?<=:\d\d),", ".", text).partition(".")
    found = re.fullmatch(r"(\d*)(\D.*)?", rest)
    # Digits alone, as of 1611120512304,5, are no date, though Python reads the year 1611.
    if found is None or re.fullmatch(r"[\d,]*", whole):
        raise ValueError(f"'{text}' is not a time")
    fraction, zone = found[1] or "0", found[2] or ""
    moment = datetime.fromisoformat(whole + zone)
    moment = moment.replace(tzinfo=moment.tzinfo or UTC)
    return Decimal(int(moment.timestamp())) + Decimal(f"0.{fraction}")


def recognized_unit(counts: Sequence[Decimal], usual: str, fps: float) -> str | None:
    """Returns the unit of these times: the usual one if it fits the frame rate, otherwise the
    one that gives a plausible date. None: ambiguous, so the user must specify it."""
    if not counts:
        return usual
    rest = [unit for unit in NS_PER if unit != usual]
    for unit in (usual, *rest):
        is_date = _is_date(counts, unit)
        if _fits_rate(counts, unit, fps) and (is_date or (unit == usual and _is_near(counts))):
            return unit
    if _is_date(counts, usual):
        return usual
    others_fit = any(_fits_rate(counts, unit, fps) for unit in rest)
    return usual if _is_near(counts) and not others_fit else None


def _is_date(counts: Sequence[Decimal], unit: str) -> bool:
    low, high = _EPOCH_S
    seconds = statistics.median(counts) * NS_PER[unit] / NS_PER["s"]
    return low <= seconds <= high


def _is_near(counts: Sequence[Decimal]) -> bool:
    """Returns whether the counts are relative, for example to the boot time."""
    return abs(statistics.median(counts)) < 10**17


def _fits_rate(counts: Sequence[Decimal], unit: str, fps: float) -> bool:
    step_s = _usual_step(counts) * NS_PER[unit] / NS_PER["s"]
    return step_s == 0 or 1 / _RATE_FACTOR <= float(step_s) * fps <= _RATE_FACTOR


def _usual_step(counts: Sequence[Decimal]) -> Decimal:
    ordered = sorted(counts)
    steps = [b - a for a, b in pairwise(ordered) if b > a]
    return statistics.median(steps) if steps else Decimal(0)


def unit_question(counts: Sequence[Decimal], usual: str, fps: float, where: str) -> SlambedError:
    """Returns the error that asks for the unit."""
    return SlambedError(
        f"{where}: times are {float(_usual_step(counts)):g} apart, which in {UNIT_NAMES[usual]} "
        f"does not go with fps {fps:g}; say 'reader_options: {{time_unit: s, ms, us or ns}}', or "
        "correct fps"
    )


def to_ns(count: Decimal, unit: str) -> int:
    """Converts to exact nanoseconds. Raises ValueError if that exceeds 64 bits."""
    time_ns = int((count * NS_PER[unit]).to_integral_value())
    if abs(time_ns) > LARGEST_NS:
        raise ValueError(f"{count} {unit} is further from 1970 than 292 years")
    return time_ns


def check_times(times_ns: Sequence[int], place: Place, max_gap_s: float | None) -> None:
    """Raises SlambedError if the frame times, in playback order, are implausible."""
    if len(times_ns) == 1:
        raise SlambedError(f"{place(0)}: the dataset has one frame; a sequence needs two at least")
    if times_ns and not any(times_ns):
        raise SlambedError(f"{place(0)}: the times of all frames are zero; record time stamps")
    steps = [b - a for a, b in pairwise(times_ns)]
    limit_s = _longest_gap_s(steps) if max_gap_s is None else max_gap_s
    for i, step in enumerate(steps):
        before, after = (f"{t * 1e-9:.6f} s" for t in times_ns[i : i + 2])
        if step <= 0:
            order = "the same time as" if step == 0 else "an earlier time than"
            raise SlambedError(
                f"{place(i + 1)}: frame {i + 1} ({after}) has {order} frame {i} ({before}); "
                "remove or re-time it"
            )
        if step * 1e-9 > limit_s:
            raise SlambedError(
                f"{place(i + 1)}: times jump by {_duration(step * 1e-9)} from frame {i} ({before}) "
                f"to frame {i + 1} ({after}); was the clock set while recording? Cut or re-time it "
                "there; of a true pause say 'reader_options: {max_gap_s: SECONDS}'"
            )


def _longest_gap_s(steps_ns: Sequence[int]) -> float:
    usual_s = max(0.0, statistics.median_low(steps_ns) * 1e-9) if steps_ns else 0.0
    return min(max(_GAP_S, _GAP_STEPS * usual_s), _LONGEST_GAP_S)


def _duration(seconds: float) -> str:
    for size, name in ((365.25 * 86400, "years"), (86400.0, "days"), (3600.0, "hours")):
        if seconds >= size:
            return f"{seconds / size:.1f} {name}"
    return f"{seconds:.1f} s"
