# SPDX-License-Identifier: Apache-2.0
"""The harness's hold on the sidecar of the nodes (`slambed.engines.sidecar`)."""

import os
import time
from pathlib import Path
from typing import Protocol

from slambed.engines.base import Node
from slambed.engines.sidecar_messages import (
    Follow,
    Following,
    MonitoredNode,
    OpenSidecar,
    SidecarOpened,
    Stop,
    Stopped,
)
from slambed.native import find_program
from slambed.process.line_protocol import LineProcess, Start, Started
from slambed.spec.device import Limits
from slambed.spec.system import Role

MODULE = "slambed.engines.sidecar"
START_TIMEOUT_S = 20.0
ANSWER_TIMEOUT_S = 10.0
FINE_TICK_S = 1.5e-3
"""A kernel that looks this often at quotas needs no metronome."""


class Host(Protocol):
    """Of an engine: what starts sidecars."""

    unprivileged: bool

    def sidecar_command(self, module: str, writable: list[Path]) -> list[str]: ...


class SidecarClient:
    """The harness's hold on the sidecar of a run (`engines.sidecar`): thread caps and metronome
    from its making on, samples from `start` to `stop`."""

    def __init__(
        self,
        engine: Host,
        nodes: dict[Role, Node],
        limits: dict[Role, Limits],
        cpus: dict[Role, list[int]],
        run_dir: Path,
        whole_groups: bool = False,
    ) -> None:
        """`nodes`: those of this host; `whole_groups`: a node may be several processes, all of its
        control group."""
        samples = (run_dir / "samples.jsonl").resolve()
        # Made here, so that it belongs to whoever runs the harness; a helper may be another user.
        samples.touch()
        samples.chmod(0o666)
        ticked = metronome_cpus(limits, cpus)
        asked = OpenSidecar(
            nodes={
                role: MonitoredNode(
                    pid=node.pid,
                    thread_cores=limits[role].thread_cores,
                    period_ms=limits[role].period_ms,
                    # The edge sees the same connections from its end.
                    namespace=str(node.namespace) if role == "mobile" else None,
                )
                for role, node in nodes.items()
            },
            samples=str(samples),
            cpus=free_cpus(cpus, sorted(os.sched_getaffinity(0))),
            pace=str(find_program("slambed-pace")) if ticked else None,
            metronome_cpus=ticked,
            helper=engine.unprivileged,
            whole_groups=whole_groups,
        )
        command = engine.sidecar_command(MODULE, [samples])
        self._process = LineProcess(command, "sampler", run_dir / "sampler_errors.txt")
        self._seen: Stopped | None = None
        try:
            self._process.ask(asked, SidecarOpened, START_TIMEOUT_S)
        except BaseException:
            self._process.close()
            raise

    def start(self, t0_ns: int) -> None:
        """Begins to sample; run time = CLOCK_MONOTONIC - t0_ns."""
        self._process.ask(Start(t0_ns=t0_ns), Started, ANSWER_TIMEOUT_S)

    def follow(self, role: Role, node: Node) -> None:
        """The node's program was started again."""
        self._process.ask(Follow(node=role, pid=node.pid), Following, ANSWER_TIMEOUT_S)

    def stop(self) -> Stopped:
        """What was seen; ends after one last sample. Calling it again returns the same."""
        if self._seen is None:
            try:
                seen = self._process.ask(Stop(), Stopped, ANSWER_TIMEOUT_S)
            finally:
                self._process.close()
            own = seen.own.model_copy(update={"kernel_tick_ms": kernel_tick_s() * 1e3})
            self._seen = seen.model_copy(update={"own": own})
        return self._seen

    def close(self) -> None:
        """Ends the process without a report; harmless after `stop`."""
        self._process.close()


def free_cpus(cpus: dict[Role, list[int]], host: list[int]) -> list[int]:
    """Where the sampler disturbs least: outside of both nodes, else outside of the mobile one."""
    mobile = set(cpus.get("mobile", []))
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
