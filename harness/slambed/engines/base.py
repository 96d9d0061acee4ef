# SPDX-License-Identifier: Apache-2.0
"""The interface of engines: an engine holds a node before its first instruction, releases it,
and ends it."""

import os
import select
import signal
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import psutil

from slambed.engines.sidecar_messages import Stopped
from slambed.records.board import BoardFacts
from slambed.records.manifest import EngineFacts
from slambed.sampling.cgroup import Granted
from slambed.sampling.record import ThreadCap
from slambed.spec.device import Limits
from slambed.spec.runtime import Runtime
from slambed.spec.system import Role

LABEL = "slambed"
"""Label of containers and name of the parent cgroup."""
NODE_UID = 10001
"""User id of a node's process and owner of its output: no user on the host has this id."""


@dataclass(frozen=True)
class NodePlan:
    """One node as the engine starts it."""

    role: Role
    run_key: str
    run_dir: Path
    """Path on the host; the node finds it at `engine.output_path`."""
    sequence: Path
    limits: Limits
    cpus: list[int]
    """Host CPUs that the node may use."""
    dies: bool = False
    """It will be killed on purpose, so its network namespace must outlive it."""
    runtime: Runtime | None = None
    """For a system with its own program."""
    system_folder: Path | None = None
    """Folder of that system on the host."""
    frames: Path | None = None
    """Recorded folder on the host, for a system that reads one."""
    limit_bytes: int | None = None
    """Largest file that it may write, and most of what it may print; None: no limit."""
    host_network: bool = False
    """It uses the network of the host, so that another machine can reach it."""


LOG_END_BYTES = 1 << 16
"""In which the last words of a program are looked for."""
EDGE_CONFIG = "run_edge.json"


def config_name(plan: NodePlan) -> str:
    """Returns the name of the node's run configuration; the edge has its own file if only it
    needs some files."""
    own = plan.role == "edge" and (plan.run_dir / EDGE_CONFIG).is_file()
    return EDGE_CONFIG if own else "run.json"


class Node(Protocol):
    """A node started by an engine; it waits at the start barrier until `release`."""

    role: Role
    pid: int
    """Process id on its machine."""
    namespace: Path
    """Its network namespace as seen by the sidecars of the run. For a node on another machine,
    the namespace that leads to it."""
    granted: Granted

    def release(self) -> None:
        """Opens the start barrier: the program starts."""

    def exit_code(self) -> int | None:
        """Returns None while it runs; negative for a signal."""

    def out_of_memory(self) -> bool:
        """Returns True if the kernel killed it for exceeding its memory limit."""

    def ask_to_stop(self) -> None:
        """Sends SIGTERM: the node finishes early and writes all files."""

    def kill(self) -> None:
        """Sends SIGKILL and waits for the end."""

    def freeze(self, frozen: bool) -> None:
        """Freezes or continues its processes; the kernel's TCP stack keeps running."""

    def is_frozen(self) -> bool:
        """Returns whether `freeze` has taken effect; False if it has gone."""

    def remove(self) -> None:
        """Removes everything but the output files; safe to call twice."""


class Sidecar(Protocol):
    """The sidecar of the running nodes: thread caps and metronome from its creation on, samples
    from `start` to `stop`."""

    def start(self, t0_ns: int) -> None:
        """Starts sampling; run time = CLOCK_MONOTONIC - t0_ns."""

    def follow(self, role: Role, node: Node) -> None:
        """Switches to the restarted program of a node."""

    def stop(self) -> Stopped:
        """Takes one last sample, ends, and returns the results. Calling it again returns the
        same results."""

    def close(self) -> None:
        """Ends without a report; harmless after `stop`."""


class SegmenterSidecar(Protocol):
    """The segmenter process of a run."""

    def await_ready(self, stopped: Callable[[], bool]) -> None:
        """Returns when it is ready or the run was stopped. Raises a one-line SlambedError for a
        network that cannot be loaded."""

    def ended(self) -> str | None:
        """Returns how it ended on its own or was killed; None while it runs."""

    def is_ready(self) -> bool:
        """Returns whether it is ready, without waiting."""

    def close(self) -> float | None:
        """Ends it and returns its CPU seconds; None if it could not report them. Safe to call
        twice."""


class Engine(Protocol):
    """Runs two nodes on this host, or one of them on another machine."""

    name: str
    unprivileged: bool
    """True without root privileges; helper containers then do privileged work."""
    edge_address: str
    """Address at which the edge listens and the mobile node connects."""
    start_ahead_s: float
    """How long before run time 0 the nodes receive the start time."""

    def sequence_path(self, sequence: Path, role: Role) -> str:
        """Returns the path of the sequence as the node sees it."""

    def output_path(self, run_dir: Path, role: Role) -> str:
        """Returns the path of the output folder as the node sees it."""

    def allot(self, limits: dict[Role, Limits]) -> dict[Role, list[int]]:
        """Returns the CPUs of each node on its machine."""

    def start_sidecar(
        self,
        nodes: dict[Role, Node],
        limits: dict[Role, Limits],
        cpus: dict[Role, list[int]],
        run_dir: Path,
        whole_groups: bool,
    ) -> Sidecar:
        """Starts the sidecar of these nodes, which wait at the start barrier. `whole_groups`: a
        node may consist of all processes in its cgroup."""

    def send_start(self, run_dir: Path, t0_ns: int) -> None:
        """Writes `start.json` for the nodes: run time 0 on CLOCK_MONOTONIC of this host."""

    def board_facts(self) -> BoardFacts | None:
        """Returns the facts about the board of the mobile node in the run that has just ended."""

    def describe(self) -> EngineFacts:
        """Returns facts for the manifest, such as the image id."""

    def image_ids(self, runtime: Runtime, system: str) -> dict[str, str]:
        """Returns role -> image id of a system with its own program; empty without containers."""

    def start(self, plan: NodePlan) -> Node:
        """Starts the node up to the start barrier: namespaces and limits are in place, the
        program has not started."""

    def start_again(self, plan: NodePlan, dead: Node) -> Node:
        """Restarts the program of a killed node that `dies`, in the same namespace and with the
        same limits, past the start barrier."""

    def start_segmenter(self, plan: NodePlan, edge: Node, network: str) -> SegmenterSidecar:
        """Starts a segmenter next to the edge node of this plan, which waits at the start
        barrier. Its only connection is a socket."""

    def sidecar_command(
        self, module: str, writable: list[Path], readable: Sequence[Path] = ()
    ) -> list[str]:
        """Returns the command that runs a module of slambed as a sidecar of the running nodes,
        with the privileges it needs. It may write to the files and folders in `writable`, and read
        those in `readable`."""


def netns(pid: int) -> Path:
    """Returns the network namespace of a process."""
    return Path(f"/proc/{pid}/ns/net")


def is_stopped(pid: int) -> bool:
    """Returns whether the process is stopped by SIGSTOP; False if it has gone."""
    try:
        return psutil.Process(pid).status() == psutil.STATUS_STOPPED
    except psutil.NoSuchProcess:
        return False


class ProcessWatch:
    """Watches whether a process is alive, even if its process id has been reused."""

    def __init__(self, pid: int) -> None:
        self._fd = os.pidfd_open(pid)

    def alive(self) -> bool:
        """Returns False once the process has ended."""
        return not select.select([self._fd], [], [], 0)[0]

    def wait(self, timeout_s: float) -> bool:
        """Returns whether it ended within the time."""
        return bool(select.select([self._fd], [], [], timeout_s)[0])

    def signal(self, number: int) -> None:
        """Sends a signal, unless the process has ended."""
        try:
            signal.pidfd_send_signal(self._fd, number)
        except ProcessLookupError:
            return

    def close(self) -> None:
        """Closes the descriptor."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1


def differences(limits: Limits, granted: Granted, cpus: list[int]) -> list[str]:
    """Lists differences between configured and granted limits; empty if there are none."""
    found: list[str] = []
    quota = limits.quota_cores
    # The kernel stores the quota per period in whole microseconds.
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
        found.append(f"memory {granted.memory_mb} MiB instead of {limits.memory_mb}")
    return found


def thread_invalid_reasons(role: str, threads: list[ThreadCap], limits: Limits) -> list[str]:
    """Lists the threads of a node whose caps are missing or wrong."""
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
    """Parses CPU numbers from a kernel list such as `0-2,5`."""
    numbers: list[int] = []
    for part in filter(None, text.split(",")):
        first, _, last = part.partition("-")
        numbers += range(int(first), int(last or first) + 1)
    return sorted(numbers)


def allot_cpus(mobile: Limits, edge: Limits | None, host: list[int]) -> dict[Role, list[int]]:
    """Returns the CPUs of each node: separate if the host has enough, otherwise shared.

    The mobile node takes the first CPUs, the edge the last ones.
    """
    host = sorted(host)
    allotted: dict[Role, list[int]] = {"mobile": host[: mobile.cores or len(host)]}
    if edge is not None:
        allotted["edge"] = host[-(edge.cores or len(host)) :]
    return allotted


LONGEST_LINE = 500
"""Of what a program printed, in a reason."""


def last_line(path: Path) -> str:
    """Returns the last line of a log, preferring one that starts with `error:`, then the exception
    that ends a Python traceback: libraries print more lines while the program ends. Reads only the
    end of the log: a program may print gigabytes."""
    lines: list[str] = []
    with suppress(OSError), path.open("rb") as log:
        log.seek(max(0, path.stat().st_size - LOG_END_BYTES))
        lines = log.read().decode(errors="replace").strip().splitlines()
    error_lines = [line for line in lines if line.startswith("error:")]
    return (error_lines or _exceptions(lines) or lines or ["it printed nothing"])[-1][:LONGEST_LINE]


def _exceptions(lines: list[str]) -> list[str]:
    """Returns the last line of each Python traceback: the first one after its indented lines."""
    found, inside = [], False
    for line in lines:
        if line.startswith("Traceback (most recent call last)"):
            inside = True
        elif inside and line and not line[0].isspace():
            found.append(line)
            inside = False
    return found
