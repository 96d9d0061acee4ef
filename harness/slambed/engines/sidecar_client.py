# SPDX-License-Identifier: Apache-2.0
"""The harness side of the sidecar (`slambed.engines.sidecar`)."""

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
from slambed.process.cpus import own_cpus
from slambed.process.line_protocol import LineProcess, Start, Started
from slambed.spec.device import Limits
from slambed.spec.system import Role

MODULE = "slambed.engines.sidecar"
START_TIMEOUT_S = 20.0
ANSWER_TIMEOUT_S = 10.0
FINE_TICK_S = 1.5e-3
"""A kernel with such a short tick enforces quotas in time and needs no metronome."""


class Host(Protocol):
    """The part of an engine that starts sidecars."""

    unprivileged: bool

    def sidecar_command(self, module: str, writable: list[Path]) -> list[str]: ...


class SidecarClient:
    """The harness side of a run's sidecar (`engines.sidecar`): thread caps and metronome from
    its creation on, samples from `start` to `stop`."""

    def __init__(
        self,
        engine: Host,
        nodes: dict[Role, Node],
        limits: dict[Role, Limits],
        cpus: dict[Role, list[int]],
        run_dir: Path,
        whole_groups: bool = False,
    ) -> None:
        """`nodes`: those on this host; `whole_groups`: a node may consist of all processes in
        its cgroup."""
        samples = (run_dir / "samples.jsonl").resolve()
        # Created here, so that it belongs to the harness's user; a helper may run as another user.
        samples.touch()
        samples.chmod(0o666)
        ticked = metronome_cpus(limits, cpus)
        asked = OpenSidecar(
            nodes={
                role: MonitoredNode(
                    pid=node.pid,
                    thread_cores=limits[role].thread_cores,
                    period_ms=limits[role].period_ms,
                    # The edge would see the same connections from its side.
                    namespace=str(node.namespace) if role == "mobile" else None,
                )
                for role, node in nodes.items()
            },
            samples=str(samples),
            cpus=free_cpus(cpus, own_cpus()),
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
        """Starts sampling; run time = CLOCK_MONOTONIC - t0_ns."""
        self._process.ask(Start(t0_ns=t0_ns), Started, ANSWER_TIMEOUT_S)

    def follow(self, role: Role, node: Node) -> None:
        """Switches to the restarted program of a node."""
        self._process.ask(Follow(node=role, pid=node.pid), Following, ANSWER_TIMEOUT_S)

    def stop(self) -> Stopped:
        """Takes one last sample, ends, and returns the results. Calling it again returns the
        same results."""
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
    """Returns CPUs for the sampler: outside of both nodes, or else outside of the mobile one."""
    mobile = set(cpus.get("mobile", []))
    both = mobile.union(*cpus.values())
    return [c for c in host if c not in both] or [c for c in host if c not in mobile] or host


def kernel_tick_s() -> float:
    """Returns the tick period of the kernel's scheduler, 1 / CONFIG_HZ."""
    return time.clock_getres(6)  # CLOCK_MONOTONIC_COARSE, which advances with the tick


def metronome_cpus(limits: dict[Role, Limits], cpus: dict[Role, list[int]]) -> list[int]:
    """Returns the CPUs of nodes with a quota, on a kernel whose tick is too long for short quota
    periods."""
    if kernel_tick_s() <= FINE_TICK_S:
        return []
    limited = [cpus[role] for role, asked in limits.items() if asked.quota_cores is not None]
    return sorted({cpu for own in limited for cpu in own})
