# SPDX-License-Identifier: Apache-2.0
"""Parses RTTs from ping output: iputils (any language, with -D), busybox, BSD and macOS, fping,
Windows."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime

_NUMBER = r"(\d+(?:[.,]\d+)?)"
# Matches `icmp_seq=7 ttl=57 time=11,3 ms`. Words differ between languages, their order does not.
_UNIX = re.compile(rf"seq=(\d+)\s+[^\s=]+=\d+\s+[^\s=<]+\s*[=<]+\s*{_NUMBER}\s*(\D*)")
# Matches `1.1.1.1 : [7], 84 bytes, 11.3 ms (11.4 avg, 0% loss)`.
_FPING = re.compile(rf":\s*\[(\d+)\],\s+(?:\d+ bytes,\s+)?{_NUMBER}\s+(ms)\b")
# Matches `time=12ms TTL=57` and `time<1ms`. IPv6 has no TTL; the statistics lines have a blank
# after `=`.
_WINDOWS = re.compile(rf"\s[^\s=<]+\s?[=<]{_NUMBER}\s?([^\W\d]+)(?:\s+TTL=\d+)?\s*$", re.I)
# Marks duplicates, such as `(DUP!)`, in any language.
_MARKED = "!)"
# Matches the stamps of `ping -D` and `fping -D`, and those of `ping | ts '%.s'` or a date of `ts`.
_STAMP = re.compile(
    r"\s*(?:\[(?P<s>\d+(?:\.\d+)?)\]|(?P<bare>\d{9,10}(?:\.\d+)?)\s"
    r"|(?P<date>\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d{1,6})?)\D)"
)
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


def read_ping(lines: list[str]) -> PingLog:
    """Parses the replies of either format. Raises ValueError if the file contains two logs."""
    unix = [
        (line, found)
        for line in lines
        if (found := _UNIX.search(line) or _FPING.search(line)) is not None
        and any(letter.isalpha() for letter in found[3])  # otherwise the line is cut off
    ]
    return _unix(unix) if unix else PingLog(_windows(lines), False)


def _unix(replies: list[tuple[str, re.Match[str]]]) -> PingLog:
    """Unwraps sequence numbers; the first reply of a duplicate counts. If most lines have
    timestamps, the send time is the timestamp minus the RTT, and the others are left out."""
    stamps = [_stamp_s(line) for line, _ in replies]
    # A log may begin or end in the middle of a line.
    is_stamped = 2 * stamps.count(None) < len(stamps)
    echoes: dict[int, Echo] = {}
    number = int(replies[0][1][1])
    for (line, found), stamp in zip(replies, stamps, strict=True):
        if is_stamped and stamp is None:
            continue
        number += (int(found[1]) - number + _WRAP // 2) % _WRAP - _WRAP // 2
        if number in echoes:
            if not line.rstrip().endswith(_MARKED):
                raise ValueError(f"icmp_seq {found[1]} comes again, not as a duplicate")
            continue
        rtt_ms = _ms(found[2], found[3])
        sent = stamp - 1e-3 * rtt_ms if is_stamped and stamp is not None else float(number)
        echoes[number] = Echo(sent, rtt_ms)
    return PingLog([echoes[key] for key in sorted(echoes)], is_stamped)


def _stamp_s(line: str) -> float | None:
    """Returns the time at the begin of a line, in s since 1970; None if there is none."""
    if (found := _STAMP.match(line)) is None:
        return None
    if (date := found["date"]) is None:
        return float(found["s"] or found["bare"])
    try:
        return datetime.fromisoformat(date).replace(tzinfo=UTC).timestamp()
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
