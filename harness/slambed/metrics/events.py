# SPDX-License-Identifier: Apache-2.0
"""The event log of a run in memory, read from events.jsonl: tolerant of errors, but reporting
them."""

import json
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import Any

from slambed.older_names import events_of_today
from slambed.spec.faults import FAULT_FILE

Event = dict[str, Any]

NODES = ("mobile", "edge")
HARNESS = "harness"
"""Pseudo-node whose events are the injected faults."""


@dataclass
class EventLog:
    """Events of all nodes, sorted by run time; every event has `node`, `t_ns` and `type`."""

    events: list[Event] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    """Read errors, one line each; they are reported and never fatal."""

    def __post_init__(self) -> None:
        self._by_type: dict[str, list[Event]] = defaultdict(list)
        for event in self.events:
            self._by_type[event["type"]].append(event)
        self._stages: dict[tuple[str, str], list[Event]] | None = None

    def of(self, *types: str, node: str | None = None) -> list[Event]:
        """Returns events of these types in order of time, optionally of one node."""
        found = [event for kind in types for event in self._by_type.get(kind, [])]
        if len(types) > 1:
            found.sort(key=lambda event: event["t_ns"])
        return [e for e in found if e["node"] == node] if node else found

    def stages(self, node: str, *names: str) -> list[Event]:
        """Returns the timed stages of these names on a node, grouped by name. Uses an index
        because most events are stages."""
        if self._stages is None:
            self._stages = defaultdict(list)
            for event in self._by_type.get("stage", ()):
                self._stages[event["node"], str(event.get("name"))].append(event)
        return [event for name in names for event in self._stages.get((node, name), ())]


def read_jsonl(path: Path) -> tuple[list[Event], list[str]]:
    """Returns the objects of a JSON-lines file, and its problems.

    A last line truncated by a kill is normal and reported as such; other bad lines are skipped and
    counted.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        return [], [f"{path.name}: cannot be read ({error.strerror})"]
    if (whole := _all_lines(data)) is not None:
        return whole, []
    lines = _lines_of(data)
    torn_end = lines.pop()  # what follows the last newline
    objects: list[Event] = []
    bad = 0
    for line in lines:
        value = parse_line(line)
        if value is not None:
            objects.append(value)
        elif line.strip():
            bad += 1
    problems = []
    if torn_end.strip():
        value = parse_line(torn_end)
        if value is None:
            problems.append(f"{path.parent.name}/{path.name}: last line is torn, dropped")
        else:
            objects.append(value)
    if bad:
        problems.append(f"{path.parent.name}/{path.name}: {bad} unreadable lines, dropped")
    return objects, problems


def _all_lines(data: bytes) -> list[Event] | None:
    """Parses a regular file at once, which is quicker than line by line; None for any other: every
    line must be one object that ends with a newline."""
    count = data.count(b"\n")
    if not data.startswith(b"{") or data.count(b"}\n") != count or not data.endswith(b"}\n"):
        return None
    if data.count(b"\n{") != count - 1:
        return None
    try:
        found = json.loads(b"[" + data[:-1].replace(b"\n", b",\n") + b"]")
    except ValueError:
        return None
    regular = len(found) == count and set(map(type, found)) == {dict}
    return found if regular else None


def _lines_of(data: bytes) -> list[str] | list[bytes]:
    """Splits as text if possible; a line that is not UTF-8 must not invalidate the others."""
    try:
        return data.decode().split("\n")
    except UnicodeDecodeError:
        return data.split(b"\n")


_DECODER = json.JSONDecoder()


def parse_line(line: str | bytes) -> Event | None:
    """Returns the object in a line, None for anything else. Lines of a node start and end with
    braces, which allows a fast path without whitespace handling."""
    try:
        if isinstance(line, str) and line.startswith("{"):
            value, end = _DECODER.raw_decode(line)
            if end == len(line):
                return value  # type: ignore[no-any-return]
        value = json.loads(line)
    except ValueError:
        return None
    return value if isinstance(value, dict) else None


def read_events(raw_dir: Path, nodes: Iterable[str] = NODES) -> EventLog:
    """Reads `<raw_dir>/<node>/events.jsonl` of every node that wrote one, and the faults."""
    events: list[Event] = []
    problems: list[str] = []
    logs = {node: raw_dir / node / "events.jsonl" for node in nodes}
    for node, path in (logs | {HARNESS: raw_dir / FAULT_FILE}).items():
        if not path.exists():
            continue
        objects, complaints = read_jsonl(path)
        problems += complaints
        whole = [
            event
            for event in objects
            if isinstance(event.get("t_ns"), int) and isinstance(event.get("type"), str)
        ]
        for event in whole:
            event["node"] = node
        events += events_of_today(whole)
        if incomplete := len(objects) - len(whole):
            problems.append(f"{node}/{path.name}: {incomplete} events without t_ns or type")
    events.sort(key=itemgetter("t_ns"))
    return EventLog(events, problems)
