# SPDX-License-Identifier: Apache-2.0
"""The harness's hold on the process beside the nodes (`slambed.engines.attend`)."""

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slambed.engines.base import Engine, Node
from slambed.line_process import LineProcess
from slambed.native import find_program
from slambed.sampling.cgroup import Usage
from slambed.spec.device import Limits
from slambed.spec.system import Role

MODULE = "slambed.engines.attend"
START_TIMEOUT_S = 20.0
ANSWER_TIMEOUT_S = 10.0
FINE_TICK_S = 1.5e-3
"""A kernel that looks this often at quotas needs no metronome."""


@dataclass(frozen=True)
class Attended:
    """What the process saw, after the end of a run."""

    usage: dict[str, Usage]
    """Last counters of each node."""
    threads: dict[str, list[dict[str, Any]]]
    """Granted caps of each thread, for nodes that have them."""
    own: dict[str, Any]
    """What sampling and metronome took themselves."""


class Attendant:
    """Thread caps and metronome from its making on, samples from `start` to `stop`."""

    def __init__(
        self,
        engine: Engine,
        nodes: dict[Role, Node],
        limits: dict[Role, Limits],
        cpus: dict[Role, list[int]],
        run_dir: Path,
        whole_groups: bool = False,
    ) -> None:
        """`whole_groups`: a node may be several processes, all of its control group."""
        samples = (run_dir / "samples.jsonl").resolve()
        # Made here, so that it belongs to whoever runs the harness; a helper may be another user.
        samples.touch()
        samples.chmod(0o666)
        ticked = metronome_cpus(limits, cpus)
        config = {
            "nodes": {
                role: {
                    "pid": node.pid,
                    "thread_cores": limits[role].thread_cores,
                    "period_ms": limits[role].period_ms,
                    # The edge sees the same connections from its end.
                    "namespace": str(node.namespace) if role == "mobile" else None,
                }
                for role, node in nodes.items()
            },
            "samples": str(samples),
            "cpus": free_cpus(cpus, sorted(os.sched_getaffinity(0))),
            "pace": str(find_program("slambed-pace")) if ticked else None,
            "metronome_cpus": ticked,
            "helper": engine.unprivileged,
            "whole_groups": whole_groups,
        }
        command = engine.beside(MODULE, [samples])
        self._process = LineProcess(command, "sampler", run_dir / "sampler_errors.txt")
        self._done: Attended | None = None
        try:
            self._process.ask(config, START_TIMEOUT_S)
        except BaseException:
            self._process.close()
            raise

    def start(self, t0_ns: int) -> dict[str, Any]:
        """Begins to sample; run time = CLOCK_MONOTONIC - t0_ns. Returns the threads capped."""
        threads: dict[str, Any] = self._process.ask({"start": t0_ns}, ANSWER_TIMEOUT_S)["threads"]
        return threads

    def follow(self, role: Role, node: Node) -> None:
        """The node's program was started again."""
        self._process.ask({"follow": role, "pid": node.pid}, ANSWER_TIMEOUT_S)

    def stop(self) -> Attended:
        """Ends after one last sample; calling it again returns the same."""
        if self._done is None:
            try:
                told = self._process.ask({"stop": True}, ANSWER_TIMEOUT_S)
            finally:
                self._process.close()
            usage = {name: Usage(**last) for name, last in told["usage"].items()}
            own = told["own"] | {"kernel_tick_ms": kernel_tick_s() * 1e3}
            self._done = Attended(usage, told["threads"], own)
        return self._done

    def close(self) -> None:
        """Ends the process without a report; harmless after `stop`."""
        self._process.close()


def free_cpus(cpus: dict[Role, list[int]], host: list[int]) -> list[int]:
    """Where the sampler disturbs least: outside of both nodes, else outside of the mobile one."""
    mobile = set(cpus["mobile"])
    both = mobile.union(*cpus.values())
    return [c for c in host if c not in both] or [c for c in host if c not in mobile] or host


def kernel_tick_s() -> float:
    """How often the kernel's scheduler looks by itself: 1 / CONFIG_HZ."""
    return time.clock_getres(6)  # CLOCK_MONOTONIC_COARSE, which advances with the tick


def metronome_cpus(limits: dict[Role, Limits], cpus: dict[Role, list[int]]) -> list[int]:
    """CPUs of nodes with a quota, on a kernel that looks at quotas too rarely."""
    if kernel_tick_s() <= FINE_TICK_S:
        return []
    limited = [cpus[role] for role, asked in limits.items() if asked.quota_cores is not None]
    return sorted({cpu for own in limited for cpu in own})
