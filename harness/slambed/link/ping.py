# SPDX-License-Identifier: Apache-2.0
"""Round trip times of ping's output: iputils (any language, with -D), busybox, BSD and macOS,
Windows."""

from __future__ import annotations

import re
from dataclasses import dataclass

_NUMBER = r"(\d+(?:[.,]\d+)?)"
#: `icmp_seq=7 ttl=57 time=11,3 ms`: the words are translated, their order is not.
_UNIX = re.compile(rf"seq=(\d+)\s+[^\s=]+=\d+\s+[^\s=<]+\s*[=<]+\s*{_NUMBER}\s*(\D*)")
#: `time=12ms TTL=57`, `time<1ms`; IPv6 has no TTL, and the statistics have a blank behind `=`.
_WINDOWS = re.compile(rf"\s[^\s=<]+\s?[=<]{_NUMBER}\s?([^\W\d]+)(?:\s+TTL=\d+)?\s*$", re.I)
#: Of duplicates, `(DUP!)` in whatever language.
_MARKED = "!)"
_STAMP = re.compile(r"\s*\[(\d+(?:\.\d+)?)\]")
_MS_PER = {"s": 1e3, "sec": 1e3, "us": 1e-3, "usec": 1e-3, "µs": 1e-3, "μs": 1e-3}
#: Sequence numbers have 16 bits.
_WRAP = 1 << 16


@dataclass(frozen=True)
class Echo:
    """A reply: when the request was sent, in intervals or, stamped, in seconds since 1970."""

    sent: float
    rtt_ms: float


@dataclass(frozen=True)
class PingLog:
    """Replies in the order of their requests, each once."""

    echoes: list[Echo]
    is_stamped: bool


def read_ping(lines: list[str]) -> PingLog:
    """Replies of either kind of log; a mixture is none. Raises ValueError for two logs in one."""
    unix = [(line, found) for line in lines if (found := _UNIX.search(line))]
    return _unix(unix) if unix else PingLog(_windows(lines), False)


def _unix(replies: list[tuple[str, re.Match[str]]]) -> PingLog:
    """Sequence numbers go on where they wrap; of a duplicate the first reply counts. Where every
    line has its time, the request was sent a round trip before."""
    stamps = [_STAMP.match(line) for line, _ in replies]
    is_stamped = all(stamps)
    echoes: dict[int, Echo] = {}
    number = int(replies[0][1][1])
    for (line, found), stamp in zip(replies, stamps, strict=True):
        number += (int(found[1]) - number + _WRAP // 2) % _WRAP - _WRAP // 2
        if number in echoes:
            if not line.rstrip().endswith(_MARKED):
                raise ValueError(f"icmp_seq {found[1]} comes again, not as a duplicate")
            continue
        rtt_ms = _ms(found[2], found[3])
        sent = float(stamp[1]) - 1e-3 * rtt_ms if is_stamped and stamp else float(number)
        echoes[number] = Echo(sent, rtt_ms)
    return PingLog([echoes[key] for key in sorted(echoes)], is_stamped)


def _windows(lines: list[str]) -> list[Echo]:
    """Replies have no numbers: what stands between the first and the last of them is a request
    without a reply, in whatever language it is reported."""
    written = [line.rstrip() for line in lines if line.strip()]
    found = [(i, match) for i, line in enumerate(written) if (match := _WINDOWS.search(line))]
    return [Echo(float(i), _ms(match[1], match[2])) for i, match in found]


def _ms(number: str, unit: str) -> float:
    word = unit.split()[0].lower() if unit.split() else "ms"
    return float(number.replace(",", ".")) * _MS_PER.get(word, 1.0)
