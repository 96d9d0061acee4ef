# SPDX-License-Identifier: Apache-2.0
"""The injected faults of a run, from its events."""

from collections.abc import Iterable
from dataclasses import dataclass

from slambed.metrics.events import Event

NS_PER_S = 1e9


@dataclass(frozen=True)
class Span:
    """One fault from begin to end, in seconds of run time."""

    fault: str
    target: str
    begin_s: float
    end_s: float | None
    """None: until the end of the run."""

    def __str__(self) -> str:
        end = "" if self.end_s is None else f"{self.end_s:.1f}"
        return f"{self.fault} {self.begin_s:.1f}-{end}"


def spans(events: Iterable[Event]) -> list[Span]:
    """Pairs `fault_began` and `fault_ended` events; returns spans sorted by begin."""
    found: list[Span] = []
    for event in events:
        t_s = event["t_ns"] / NS_PER_S
        fault, target = str(event.get("fault")), str(event.get("target"))
        if event["type"] == "fault_began":
            found.append(Span(fault, target, t_s, None))
            continue
        for index, span in enumerate(found):
            if span.end_s is None and span.fault == fault:
                found[index] = Span(fault, target, span.begin_s, t_s)
    return found


def faults_in_words(events: Iterable[Event]) -> str | None:
    """Returns the faults as text for the summary: `kill 10.0-12.4, cut 20.0-25.0`; None without
    faults."""
    return ", ".join(map(str, spans(events))) or None
