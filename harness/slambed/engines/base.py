# SPDX-License-Identifier: Apache-2.0
"""What an engine is: it holds a node before its first instruction, lets it go, and ends it."""

import os
import select
import signal
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from slambed.engines.sidecar_messages import Stopped
from slambed.records.board import BoardFacts
from slambed.records.manifest import EngineFacts
from slambed.sampling.cgroup import Granted
from slambed.sampling.record import ThreadCap
from slambed.spec.device import Limits
from slambed.spec.runtime import Runtime
from slambed.spec.system import Role

LABEL = "slambed"
"""Containers carry this label, control groups live under this name."""
NODE_UID = 10001
"""Owner of a node's process and of what it writes: nobody on the host has this number."""


@dataclass(frozen=True)
class NodePlan:
    """One node as the engine needs it."""

    role: Role
    run_key: str
    run_dir: Path
    """On the host; the node finds it at `engine.output_path`."""
    sequence: Path
    limits: Limits
    cpus: list[int]
    """Host CPUs the node may use."""
    dies: bool = False
    """It will be killed on purpose: its network namespace has to outlive it."""
    runtime: Runtime | None = None
    """Of a system that is a program of its own."""
    system_folder: Path | None = None
    """Where that lies on the host."""
    frames: Path | None = None
    """The recorded folder, on the host, of a system that reads one."""
    host_network: bool = False
    """It is in the network of the host, so that another machine reaches it."""


EDGE_CONFIG = "run_edge.json"


def config_name(plan: NodePlan) -> str:
    """The node's run configuration: the edge has one of its own where files are for it alone."""
    own = plan.role == "edge" and (plan.run_dir / EDGE_CONFIG).is_file()
    return EDGE_CONFIG if own else "run.json"


class Node(Protocol):
    """A node that an engine started; it waits at the start barrier until `release`."""

    role: Role
    pid: int
    """On its machine."""
    namespace: Path
    """Its network namespace, as the sidecars of the run find it; of a node on another machine
    the one that leads there."""
    granted: Granted

    def release(self) -> None:
        """Opens the start barrier: the program starts."""

    def exit_code(self) -> int | None:
        """None while it runs; negative for a signal."""

    def out_of_memory(self) -> bool:
        """True when the kernel ended it because of its memory limit."""

    def ask_to_stop(self) -> None:
        """SIGTERM: finish early, write everything."""

    def kill(self) -> None:
        """SIGKILL, and waits for the end."""

    def freeze(self, frozen: bool) -> None:
        """Its processes stand still, or go on; the kernel's TCP goes on without them."""

    def remove(self) -> None:
        """Removes every trace but the output files; calling it twice is harmless."""


class Sidecar(Protocol):
    """The sidecar of the nodes while they run: caps of threads and metronome from its making on,
    samples from `start` to `stop`."""

    def start(self, t0_ns: int) -> None:
        """Begins to sample; run time = CLOCK_MONOTONIC - t0_ns."""

    def follow(self, role: Role, node: Node) -> None:
        """The node's program was started again."""

    def stop(self) -> Stopped:
        """What was seen; ends after one last sample. Calling it again returns the same."""

    def close(self) -> None:
        """Ends without a report; harmless after `stop`."""


class SegmenterSidecar(Protocol):
    """A segmenter process of a run."""

    def await_ready(self, stopped: Callable[[], bool]) -> None:
        """Returns when it answers, or when somebody stopped the run. Raises SlambedError, in a
        line, for a network that cannot be loaded."""

    def ended(self) -> str | None:
        """How it ended by itself or by somebody else, in words; None while it lives."""

    def is_ready(self) -> bool:
        """Whether it answers; does not wait for it."""

    def close(self) -> float | None:
        """Ends it; the CPU seconds that it took, None where it could not report any more. Calling
        it twice is harmless."""


class Engine(Protocol):
    """A way to run two nodes: on this host, or one of them on another."""

    name: str
    unprivileged: bool
    """True when this process is not root: then helper containers do what needs privileges."""
    edge_address: str
    """Where the edge listens, and the mobile node looks for it."""
    start_ahead_s: float
    """How long before run time 0 the nodes are given it."""

    def sequence_path(self, sequence: Path, role: Role) -> str:
        """Where a node finds the sequence."""

    def output_path(self, run_dir: Path, role: Role) -> str:
        """Where a node finds its output folder."""

    def allot(self, limits: dict[Role, Limits]) -> dict[Role, list[int]]:
        """The CPUs of each node, on whatever machine it is."""

    def start_sidecar(
        self,
        nodes: dict[Role, Node],
        limits: dict[Role, Limits],
        cpus: dict[Role, list[int]],
        run_dir: Path,
        whole_groups: bool,
    ) -> Sidecar:
        """The sidecar of these nodes, which are at the start barrier. `whole_groups`: a node may be
        several processes, all of its control group."""

    def send_start(self, run_dir: Path, t0_ns: int) -> None:
        """Writes `start.json` for the nodes: run time 0 on CLOCK_MONOTONIC of this host."""

    def board_facts(self) -> BoardFacts | None:
        """Of the run that has just ended: the board that its mobile node was on."""

    def describe(self) -> EngineFacts:
        """For the manifest: image id and the like."""

    def image_ids(self, runtime: Runtime, system: str) -> dict[str, str]:
        """Role -> id of the image that a program of its own gets; empty without containers."""

    def start(self, plan: NodePlan) -> Node:
        """Brings the node to the start barrier: namespaces and limits in place, program not
        started."""

    def start_again(self, plan: NodePlan, dead: Node) -> Node:
        """The program of a killed node that `dies`, in the same namespace, with the same limits,
        past the start barrier."""

    def start_segmenter(self, plan: NodePlan, edge: Node, network: str) -> SegmenterSidecar:
        """A segmenter beside the edge node of this plan, which is at the start barrier, with
        nothing but a socket to the world."""

    def sidecar_command(self, module: str, writable: list[Path]) -> list[str]:
        """The command that runs a module of slambed as a sidecar of the nodes that are started,
        with what it needs of privileges; it may write to these files and folders."""


def netns(pid: int) -> Path:
    """The network namespace of a process."""
    return Path(f"/proc/{pid}/ns/net")


class ProcessWatch:
    """Knows whether a process is alive, even if its number was given to another one since."""

    def __init__(self, pid: int) -> None:
        self._fd = os.pidfd_open(pid)

    def alive(self) -> bool:
        """False once the process has ended."""
        return not select.select([self._fd], [], [], 0)[0]

    def wait(self, timeout_s: float) -> bool:
        """True when it ended within the time."""
        return bool(select.select([self._fd], [], [], timeout_s)[0])

    def signal(self, number: int) -> None:
        """Sends a signal, unless the process has ended."""
        try:
            signal.pidfd_send_signal(self._fd, number)
        except ProcessLookupError:
            return

    def close(self) -> None:
        """Gives the descriptor back."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1


def differences(limits: Limits, granted: Granted, cpus: list[int]) -> list[str]:
    """What the kernel granted otherwise than asked; empty when all is as it should be."""
    found: list[str] = []
    quota = limits.quota_cores
    # The kernel keeps whole microseconds of quota per period.
    slack = 2e-3 / limits.period_ms
    if (quota is None) != (granted.quota_cores is None) or (
        quota is not None
        and granted.quota_cores is not None
        and abs(quota - granted.quota_cores) > slack
    ):
        found.append(f"CPU quota {granted.quota_cores} cores instead of {quota}")
    if limits.cores is not None and parse_cpus(granted.cpus) != sorted(cpus):
        found.append(f"CPUs {granted.cpus} instead of {','.join(map(str, cpus))}")
    if limits.memory_mb is not None and granted.memory_mb != limits.memory_mb:
        found.append(f"memory {granted.memory_mb} MB instead of {limits.memory_mb}")
    return found


def thread_invalid_reasons(role: str, threads: list[ThreadCap], limits: Limits) -> list[str]:
    """What is wrong with the caps of a node's threads, as the kernel granted them."""
    if not threads:
        return [f"{role}: no thread was capped"]
    slack = 2e-3 / limits.period_ms
    wrong = [
        thread.name
        for thread in threads
        if thread.cores is None or abs(thread.cores - (limits.thread_cores or 0)) > slack
    ]
    return [f"{role}: cap of thread {name} is not as asked" for name in wrong]


def parse_cpus(text: str) -> list[int]:
    """CPU numbers of a kernel list such as `0-2,5`."""
    numbers: list[int] = []
    for part in filter(None, text.split(",")):
        first, _, last = part.partition("-")
        numbers += range(int(first), int(last or first) + 1)
    return sorted(numbers)


def allot_cpus(mobile: Limits, edge: Limits | None, host: list[int]) -> dict[Role, list[int]]:
    """CPUs of each node. They are kept apart where the host has enough; else they share.

    The mobile node takes the first CPUs, the edge node the last ones.
    """
    host = sorted(host)
    allotted: dict[Role, list[int]] = {"mobile": host[: mobile.cores or len(host)]}
    if edge is not None:
        allotted["edge"] = host[-(edge.cores or len(host)) :]
    return allotted


def last_line(path: Path) -> str:
    """Last line of a log; an `error:` line is preferred."""
    try:
        lines = path.read_text(errors="replace").strip().splitlines()
    except OSError:
        lines = []
    error_lines = [line for line in lines if line.startswith("error:")]
    return (error_lines or lines or ["it printed nothing"])[-1]
