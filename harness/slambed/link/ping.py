# SPDX-License-Identifier: Apache-2.0
"""Parses RTTs from ping output: iputils (any language, with -D), busybox, BSD and macOS, fping,
Windows."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise

_NUMBER = r"(\d+(?:[.,]\d+)?)"
# Matches `icmp_seq=7 ttl=57 time=11,3 ms`. Words differ between languages, their order does not.
_UNIX = re.compile(rf"seq=(\d+)\s+[^\s=]+=\d+\s+[^\s=<]+\s*[=<]+\s*{_NUMBER}\s*(\D*)")
# Matches `1.1.1.1 : [7], 84 bytes, 11.3 ms (11.4 avg, 0% loss)`.
_FPING = re.compile(rf":\s*\[(\d+)\],\s+(?:\d+ bytes,\s+)?{_NUMBER}\s+(ms)\b")
# Matches `time=12ms TTL=57` and `time<1ms`. IPv6 has no TTL; the statistics lines have a blank
# after `=`.
_WINDOWS = re.compile(rf"\s[^\s=<]+\s?[=<]{_NUMBER}\s?([^\W\d]+)(?:\s+TTL=\d+)?\s*$", re.I)
_CLOCK = r"\d\d:\d\d:\d\d(?:[.,]\d{1,6})?"
# Matches the stamps of `ping -D` and `fping -D`, those of `ping --apple-time`, those of
# `ping | ts` in its forms, of syslog, and dates, in brackets or not.
_STAMP = re.compile(
    r"\s*\[?(?:\s*(?P<s>\d+(?:[.,]\d+)?)\]|(?P<bare>\d{9,10}(?:\.\d+)?|\d+\.\d{3,})\s"
    rf"|(?P<date>\d{{4}}-\d\d-\d\d[T ]{_CLOCK})\D"
    rf"|(?P<month>[A-Z][a-z]{{2}}) +(?P<day>\d{{1,2}}) (?P<of_day>{_CLOCK})\s"
    rf"|(?P<clock>{_CLOCK})\]?\s)"
)
# Matches `time=-8ms`, which Windows writes when its clock was set, `time=nan ms` and
# `time=1,234.5 ms`.
_NO_LATENCY = re.compile(
    r"[=<]\s*(?:-\s?\d[\d.,]*|nan|inf|\d[\d.,]*e[+-]?\d+|\d[\d,]*,\d+\.\d+)\s*(?:ms|s|us|[µμ]s)\b",
    re.I,
)
# Matches who replied: the last word before `: icmp_seq=`.
_REPLIED = re.compile(r"(\S+?)\s?:\s+\S*$")
_LONGEST_HOST = 300
_DAY_S = 86_400.0
_LEAP_YEAR_S = 366 * _DAY_S
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
_MS_PER = {"s": 1e3, "sec": 1e3, "us": 1e-3, "usec": 1e-3, "µs": 1e-3, "μs": 1e-3}
#: Sequence numbers have 16 bits.
_WRAP = 1 << 16


@dataclass(frozen=True)
class Echo:
    """One reply; `sent` is the request's time in intervals, or in s since 1970 if the log has
    stamps."""

    sent: float
    rtt_ms: float


@dataclass(frozen=True)
class PingLog:
    """Replies in the order of their requests, without duplicates."""

    echoes: list[Echo]
    is_stamped: bool
    unread: str = ""
    """Why its stamps cannot be used, of a log that seems to have some."""


def read_ping(lines: list[str]) -> PingLog:
    """Parses the replies of either format. Raises ValueError if the file contains two logs, or a
    time that is no latency."""
    for number, line in enumerate(lines, 1):
        if (wrong := _NO_LATENCY.search(line)) is not None:
            raise ValueError(f"line {number}: '{wrong[0]}' is no latency")
    unix = [
        (line, found)
        for line in lines
        if (found := _UNIX.search(line) or _FPING.search(line)) is not None
        and any(letter.isalpha() for letter in found[3])  # otherwise the line is cut off
    ]
    if unix:
        return _unix(unix)
    dated = [line for line in lines if _WINDOWS.search(line) and _begins_with_a_time(line)]
    return PingLog(_windows(lines), False, _UNKNOWN if dated else "")


_UNKNOWN = "its lines begin with a time of an unknown form"
_WHOLE_SECONDS = "its stamps are whole seconds, with several replies in one"
_DIFFERENCES = "its stamps fall nearly as often as they rise, like the differences of 'ts -i'"


@dataclass(frozen=True)
class _Stamp:
    """A time in s since 1970, the begin of a year or of a day, or whatever the log counts from."""

    s: float
    period_s: float = math.inf
    """When it begins again, of a date without a year or a time without a date."""


def _begins_with_a_time(line: str) -> bool:
    """Returns whether a time of day, or a number, stands before the size of the reply, `64 bytes
    from`, or a time of day before its first word."""
    words = line.split(maxsplit=4)
    # 1795651784400 64 bytes from
    if len(words) > 3 and any(map(str.isdigit, words[0])) and words[1].isdigit():
        return words[2].isalpha()
    head = re.match(r"(.*?)\d+ [^\W\d]+ [^\W\d]+ |([^A-Za-z]*)", line)
    before = (head[1] or head[2] or "") if head is not None else ""
    return re.search(r"\d:\d\d", before) is not None


def _unix(replies: list[tuple[str, re.Match[str]]]) -> PingLog:
    """Unwraps sequence numbers; the first reply of a duplicate counts. If most lines have
    timestamps, the send time is the timestamp minus the RTT, and the others are left out."""
    _must_be_one_host(replies)
    stamps = [_stamp(line) for line, _ in replies]
    # A log may begin or end in the middle of a line.
    is_stamped = 2 * stamps.count(None) < len(stamps)
    unread = ""
    if not is_stamped and 2 * sum(_begins_with_a_time(line) for line, _ in replies) > len(replies):
        unread = _UNKNOWN
    known = [
        stamp.s
        for (line, _), stamp in zip(replies, stamps, strict=True)
        if stamp is not None and not _is_duplicate(line)
    ]
    falls = sum(later < earlier for earlier, later in pairwise(known))
    if is_stamped and falls > 2 and 4 * falls > len(known):
        is_stamped, unread = False, _DIFFERENCES
    if is_stamped and len({*known}) < len(known) and all(stamp == int(stamp) for stamp in known):
        is_stamped, unread = False, _WHOLE_SECONDS
    echoes: dict[int, Echo] = {}
    number = int(replies[0][1][1])
    begin_s, previous_s = 0.0, -math.inf
    for (line, found), stamp in zip(replies, stamps, strict=True):
        if is_stamped and stamp is None:
            continue
        number += (int(found[1]) - number + _WRAP // 2) % _WRAP - _WRAP // 2
        if number in echoes:
            if not _is_duplicate(line):
                raise ValueError(f"icmp_seq {found[1]} comes again, not as a duplicate")
            continue
        rtt_ms = _ms(found[2], found[3])
        sent = float(number)
        if is_stamped and stamp is not None:
            # A date with its year that falls by so much is a clock that was set.
            if begin_s + stamp.s < previous_s - stamp.period_s / 2:
                begin_s += stamp.period_s
            previous_s = begin_s + stamp.s
            sent = previous_s - 1e-3 * rtt_ms
        echoes[number] = Echo(sent, rtt_ms)
    return PingLog([echoes[key] for key in sorted(echoes)], is_stamped, unread)


def _is_duplicate(line: str) -> bool:
    """Returns whether the line ends in a mark such as `(DUP!)`, in any language."""
    return line.rstrip().endswith("!)")


def _must_be_one_host(replies: list[tuple[str, re.Match[str]]]) -> None:
    """Raises ValueError for replies of several hosts; a multicast has all but one as duplicates."""
    hosts = [_host(line, found.start()) for line, found in replies if not _is_duplicate(line)]
    if len(several := [*dict.fromkeys(filter(None, hosts))]) > 1:
        raise ValueError(f"replies of {several[0]} and of {several[1]}")


def _host(line: str, end: int) -> str:
    """Returns who replied, `1.2.3.4` or `(1.2.3.4)` before `: icmp_seq`, in French
    ` : icmp_seq`; empty if unknown."""
    found = _REPLIED.search(line, max(0, end - _LONGEST_HOST), end)
    return found[1].strip("()") if found is not None else ""


def _stamp(line: str) -> _Stamp | None:
    """Returns the time at the begin of a line; None if there is none. Where there are two, as of
    `ping -D | ts`, the second one is ping's own."""
    if (found := _STAMP.match(line)) is None:
        return None
    second = _STAMP.match(line, found.end())
    return (_read_stamp(second) if second is not None else None) or _read_stamp(found)


def _read_stamp(found: re.Match[str]) -> _Stamp | None:
    if (number := found["s"] or found["bare"]) is not None:
        seconds = float(number.replace(",", "."))
        return _Stamp(seconds) if math.isfinite(seconds) else None
    date, period_s = found["date"], math.inf
    if (clock := found["clock"]) is not None:
        date, period_s = f"1970-01-01 {clock}", _DAY_S
    elif (month := found["month"]) is not None:
        if month not in _MONTHS:
            return None
        # A leap year, as any day may be meant.
        date = f"1972-{_MONTHS.index(month) + 1:02}-{int(found['day']):02} {found['of_day']}"
        period_s = _LEAP_YEAR_S
    try:
        return _Stamp(datetime.fromisoformat(date).replace(tzinfo=UTC).timestamp(), period_s)
    except ValueError:
        return None


def _windows(lines: list[str]) -> list[Echo]:
    """Windows replies have no numbers: each other line between the first and the last reply
    counts as a request without a reply, whatever its language."""
    written = [line.rstrip() for line in lines if line.strip()]
    found = [(i, match) for i, line in enumerate(written) if (match := _WINDOWS.search(line))]
    return [Echo(float(i), _ms(match[1], match[2])) for i, match in found]


def _ms(number: str, unit: str) -> float:
    word = unit.split()[0].lower() if unit.split() else "ms"
    return float(number.replace(",", ".")) * _MS_PER.get(word, 1.0)
