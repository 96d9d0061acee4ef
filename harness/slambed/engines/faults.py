# SPDX-License-Identifier: Apache-2.0
"""Injects the faults of a run and logs when each one began and ended.

`faults.jsonl` in the run folder becomes events of the node `harness` (docs/reference/events.md).
"""

import json
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from slambed.engines.base import Engine, Node, NodePlan, Sidecar
from slambed.errors import PassingError
from slambed.spec.faults import FAULT_FILE, Fault
from slambed.spec.system import Role

NS_PER_S = 1e9
SIGNAL_TIMEOUT_S = 2.0
LATE_S = 0.5
"""A fault that is later than this makes the run invalid."""


class Edge(Protocol):
    """Actions on the edge node of a run."""

    def kill(self) -> None: ...
    def freeze(self, frozen: bool) -> None: ...
    def start_again(self) -> None: ...


@dataclass(frozen=True)
class RunEdge:
    """The edge node of a live run; a restarted node replaces it in `nodes`."""

    engine: Engine
    plan: NodePlan | None
    nodes: dict[Role, Node]
    sidecar: Sidecar
    cleanup: ExitStack

    def kill(self) -> None:
        """Sends SIGKILL and waits for the end."""
        self.nodes["edge"].kill()

    def freeze(self, frozen: bool) -> None:
        """Freezes or continues the node and waits until it has taken effect, so that only real
        faults are logged."""
        node = self.nodes["edge"]
        node.freeze(frozen)
        deadline = time.monotonic() + SIGNAL_TIMEOUT_S
        while node.exit_code() is None and node.is_frozen() != frozen:
            if time.monotonic() > deadline:
                word = "frozen" if frozen else "woken"
                raise PassingError(f"the edge node was not {word}, process {node.pid}")
            time.sleep(0.001)

    def start_again(self) -> None:
        """Restarts its program in the namespace and cgroups of the killed one."""
        assert self.plan is not None
        node = self.engine.start_again(self.plan, self.nodes["edge"])
        self.cleanup.callback(node.remove)
        self.nodes["edge"] = node
        self.sidecar.follow("edge", node)


@dataclass(frozen=True)
class Step:
    """One action at a run time."""

    at_s: float
    fault: str
    target: str
    begins: bool


def steps(faults: list[Fault]) -> list[Step]:
    """Returns begins and ends in order of time; a restart is the end of a kill."""
    found: list[Step] = []
    for fault in faults:
        if fault.edge == "restart":
            found.append(Step(fault.at_s, "kill", "edge", begins=False))
            continue
        found.append(Step(fault.at_s, fault.kind, fault.target, begins=True))
        if fault.for_s is not None:
            found.append(Step(fault.end_s, fault.kind, fault.target, begins=False))
    return sorted(found, key=lambda step: step.at_s)


@dataclass(frozen=True)
class FaultEvent:
    """One line of the log (docs/reference/events.md, "Events")."""

    t_ns: int
    type: str
    target: str
    fault: str


def event(step: Step, t_ns: int) -> FaultEvent:
    """Returns the log line of a step."""
    kind = "fault_began" if step.begins else "fault_ended"
    return FaultEvent(t_ns, kind, step.target, step.fault)


def write_planned(faults: list[Fault], end_s: float, run_dir: Path) -> None:
    """Writes the log of a virtual run, in which every fault happens exactly on time."""
    if not faults:
        return
    events = (vars(event(s, round(s.at_s * NS_PER_S))) for s in steps(faults) if s.at_s <= end_s)
    _write(run_dir, events)


class FaultDriver:
    """Executes due steps. The link cuts itself, since its profile has the gaps; here cuts are
    only logged."""

    def __init__(self, faults: list[Fault], edge: Edge, run_dir: Path) -> None:
        self._left = steps(faults)
        self._edge = edge
        self._run_dir = run_dir
        self._done: list[dict[str, object]] = []
        self._frozen: Step | None = None
        self._t0_ns = 0
        self.edge_is_dead = False
        """The edge was killed by a fault and not restarted since."""
        self.invalid_reasons: list[str] = []
        """Why the faults did not happen as planned, one line each."""

    def start(self, t0_ns: int) -> None:
        """Sets run time 0 on CLOCK_MONOTONIC."""
        self._t0_ns = t0_ns

    def wait_s(self, longest_s: float) -> float:
        """Returns the time until the next step, at most `longest_s`."""
        if not self._left:
            return longest_s
        return min(longest_s, max(0.0, self._left[0].at_s - self._now_s()))

    def act(self) -> None:
        """Executes every step that is due."""
        while self._left and self._left[0].at_s <= self._now_s():
            self._do(self._left.pop(0))

    def finish(self) -> None:
        """Drops the remaining faults; a frozen edge is continued so that it can end."""
        self._left = []
        if self._frozen is not None:
            self._do(Step(self._now_s(), "freeze", "edge", begins=False))

    def note(self, kind: str, **fields: object) -> None:
        """Logs an event that is no planned fault, such as a failure or a recovery."""
        at_ns = time.monotonic_ns() - self._t0_ns
        self._done.append({"t_ns": at_ns, "type": kind} | fields)

    def write(self) -> None:
        """Writes the log to the run folder."""
        if self._done:
            _write(self._run_dir, iter(self._done))

    def _now_s(self) -> float:
        return (time.monotonic_ns() - self._t0_ns) / NS_PER_S

    def _do(self, step: Step) -> None:
        if step.fault == "freeze":
            self._edge.freeze(step.begins)
            self._frozen = step if step.begins else None
        elif step.fault == "kill" and step.begins:
            self.edge_is_dead = True  # set first: the end is expected
            self._edge.kill()
        elif step.fault == "kill":
            self._edge.start_again()
            self.edge_is_dead = False
        at_ns = time.monotonic_ns()
        if step.fault == "cut":
            at_ns = self._t0_ns + round(step.at_s * NS_PER_S)
        self._done.append(vars(event(step, at_ns - self._t0_ns)))
        self._judge(step, (at_ns - self._t0_ns) / NS_PER_S)

    def _judge(self, step: Step, at_s: float) -> None:
        """The time that a program needs to restart is not limited."""
        if at_s - step.at_s > LATE_S and (step.begins or step.fault == "freeze"):
            what = f"{step.target}'s {step.fault}"
            self.invalid_reasons.append(
                f"{'the' if step.begins else 'the end of the'} {what} came at {at_s:.1f} s, "
                f"not at {step.at_s:.1f} s"
            )


def _write(run_dir: Path, events: Iterator[dict[str, object]]) -> None:
    lines = [json.dumps(line) + "\n" for line in events]
    (run_dir / FAULT_FILE).write_text("".join(lines), encoding="utf-8")
