# SPDX-License-Identifier: Apache-2.0
"""Engine `local`: nodes as processes in network namespaces and cgroups, without a daemon."""

import contextlib
import os
import select
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import psutil

from slambed.engines import launcher
from slambed.engines.base import (
    NODE_UID,
    Node,
    NodePlan,
    ProcessWatch,
    SegmenterSidecar,
    config_name,
    is_stopped,
    last_line,
    netns,
)
from slambed.engines.cgroups import CgroupMaker, entry_files, remove
from slambed.engines.foreign import (
    PLAYER,
    clients_folder,
    environment,
    host_path,
    player_arguments,
)
from slambed.engines.helper import direct_command
from slambed.engines.segmenter import ENVIRONMENT, LOG, SOCKET, SegmenterProcess, make_folder
from slambed.engines.segmenter import command as segmenter_command
from slambed.engines.this_host import ThisHostEngine
from slambed.errors import KilledError, PassingError, SlambedError, environment_error
from slambed.native import find_program
from slambed.process.endings import ended_from_outside, ending
from slambed.records.manifest import EngineFacts
from slambed.sampling.cgroup import CgroupPaths, CgroupReader, GroupProcesses
from slambed.spec.runtime import Runtime
from slambed.spec.system import Role

BARRIER_TIMEOUT_S = 20.0
KILL_TIMEOUT_S = 10.0
AT_REST = (psutil.STATUS_STOPPED, psutil.STATUS_ZOMBIE, psutil.STATUS_DISK_SLEEP)


class LocalNode:
    """A child process that waits at the start barrier and then becomes the node."""

    def __init__(
        self,
        role: Role,
        process: subprocess.Popen[bytes],
        paths: CgroupPaths,
        *,
        several_processes: bool = False,
    ) -> None:
        self.role = role
        self.pid = process.pid
        self.namespace = netns(process.pid)
        self.reader = CgroupReader(paths)
        self.granted = self.reader.granted()
        self._process = process
        self._watch = ProcessWatch(process.pid)
        self.paths = paths
        self._namespace_fd = -1
        self.several_processes = several_processes
        """A user's program, which may have started others."""

    def keep_namespace(self) -> None:
        """Keeps the network namespace until `remove`, even without the process."""
        self._namespace_fd = os.open(self.namespace, os.O_RDONLY | os.O_CLOEXEC)
        self.namespace = Path(f"/proc/{os.getpid()}/fd/{self._namespace_fd}")

    def hand_over_namespace(self) -> int:
        """Returns the descriptor; the caller must close it."""
        fd, self._namespace_fd = self._namespace_fd, -1
        return fd

    def take_over_namespace(self, dead: "LocalNode") -> None:
        """Takes the namespace of the node that this one replaces."""
        self.namespace, self._namespace_fd = dead.namespace, dead.hand_over_namespace()

    def release(self) -> None:
        """Opens the start barrier."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(b"g")
            self._process.stdin.close()
        except BrokenPipeError:
            pass  # It died at the start barrier; exit_code() reports that.

    def exit_code(self) -> int | None:
        """Returns None while it runs."""
        return self._process.poll()

    def wait(self) -> int:
        """Returns the exit code of a process that is about to end."""
        return self._process.wait(KILL_TIMEOUT_S)

    def out_of_memory(self) -> bool:
        """Uses the counter of its cgroup."""
        return self.reader.oom_kills() > 0

    def ask_to_stop(self) -> None:
        if self._process.poll() is None:
            self._watch.signal(signal.SIGTERM)

    def kill(self) -> None:
        if self._process.poll() is None:
            self._watch.signal(signal.SIGKILL)
            self._process.wait(KILL_TIMEOUT_S)
        if self.several_processes:
            self._signal_all(signal.SIGKILL)

    def freeze(self, frozen: bool) -> None:
        """Sends SIGSTOP or SIGCONT to its process group, or to all that a user's program started:
        these have groups of their own."""
        if self._process.poll() is not None:
            return
        number = signal.SIGSTOP if frozen else signal.SIGCONT
        if self.several_processes:
            self._signal_all(number)
        else:
            os.killpg(self.pid, number)

    def is_frozen(self) -> bool:
        """Returns whether its program is stopped, with all that it started."""
        if not self.several_processes:
            return is_stopped(self.pid)
        return not any(map(_can_run, GroupProcesses(self.paths).pids()))

    def _signal_all(self, number: signal.Signals) -> None:
        """Signals all processes of its cgroup, and those that they start meanwhile."""
        group, done = GroupProcesses(self.paths), set[int]()
        while new := set(group.pids()) - done:
            for pid in sorted(new):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, number)
            done |= new

    def remove(self) -> None:
        """Kills the process and removes its cgroups."""
        self.kill()
        if self._namespace_fd >= 0:
            os.close(self.hand_over_namespace())
        if self._process.stdin is not None and not self._process.stdin.closed:
            self._process.stdin.close()
        self._watch.close()
        folders = {*self.paths.folders.values()}
        if self.paths.unified is not None:
            folders.add(self.paths.unified)
        for folder in folders:
            remove(folder)


def _can_run(pid: int) -> bool:
    """Returns whether a process to which SIGSTOP was sent may still run code of its program. One in
    an uninterruptible wait does not: it stops when the wait ends. A shell that starts a program
    waits so (vfork) until that one runs, and does for ever if that one is stopped before."""
    try:
        status = psutil.Process(pid).status()
    except psutil.NoSuchProcess:
        return False
    return status not in AT_REST


class LocalEngine(ThisHostEngine):
    """Runs nodes without a daemon. Needs root."""

    name = "local"

    def __init__(self, program: Path | None = None) -> None:
        if os.geteuid() != 0:
            raise environment_error(
                "no permission for network namespaces and cgroups (engine local); run the same "
                "command with sudo, or with --engine virtual, which needs no privilege"
            )
        self._program = program or find_program("slambed-node")
        self._groups = CgroupMaker()

    def sequence_path(self, sequence: Path, role: Role) -> str:
        """Same path as on the host."""
        return str(sequence.resolve())

    def output_path(self, run_dir: Path, role: Role) -> str:
        """Same path as on the host."""
        return str(run_dir.resolve())

    def describe(self) -> EngineFacts:
        """Returns no image."""
        return EngineFacts(image_id=None)

    def image_ids(self, runtime: Runtime, system: str) -> dict[str, str]:
        """Returns nothing: programs run on this host."""
        return {}

    def sidecar_command(
        self, module: str, writable: list[Path], readable: Sequence[Path] = ()
    ) -> list[str]:
        """Returns a child process command, since this process is root."""
        return direct_command(module)

    def start(self, plan: NodePlan) -> Node:
        """Starts a process at the start barrier, in its own network namespace and cgroups."""
        node = self._launch(plan, None)
        if plan.dies:
            node.keep_namespace()
        return node

    def start_again(self, plan: NodePlan, dead: Node) -> Node:
        """Restarts a killed node; its cgroups still exist, and `make` finds them."""
        assert isinstance(dead, LocalNode)
        node = self._launch(plan, dead)
        node.release()
        return node

    def start_segmenter(self, plan: NodePlan, edge: Node, network: str) -> SegmenterSidecar:
        """Starts the segmenter in the edge's cgroups, as the edge's user, in a network namespace
        with loopback only. It dies with this process."""
        assert isinstance(edge, LocalNode)
        folder = make_folder(plan.run_dir)
        os.chown(folder, NODE_UID, NODE_UID)
        log_file = folder / LOG
        nobody = os.open(os.devnull, os.O_WRONLY)
        command = [
            *self._launcher(nobody, -1, edge.paths),
            *segmenter_command(str(folder / SOCKET), network),
        ]
        try:
            with log_file.open("ab") as log:
                process = subprocess.Popen(
                    command,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    pass_fds=[nobody],
                    cwd="/",
                    env=os.environ | ENVIRONMENT,
                    start_new_session=True,
                )
        finally:
            os.close(nobody)
        assert process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            process.stdin.write(b"g")  # opens the start barrier at once
            process.stdin.flush()
        return SegmenterProcess(process, log_file)

    @staticmethod
    def _launcher(
        ready_fd: int, network_fd: int, paths: CgroupPaths, limit_bytes: int | None = None
    ) -> list[str]:
        limits = [NODE_UID] if limit_bytes is None else [NODE_UID, limit_bytes]
        return [
            *(sys.executable, "-I", "-S", launcher.__file__, str(os.getpid())),
            ",".join(str(fd) for fd in (ready_fd, network_fd) if fd >= 0),
            ",".join(map(str, limits)),
            *map(str, entry_files(paths)),
            "--",
        ]

    def _program_of(self, plan: NodePlan) -> list[str]:
        config = str(plan.run_dir.resolve() / config_name(plan))
        if plan.runtime is None:
            return [str(self._program), "--role", plan.role, "--config", config]
        player, frames = str(find_program(PLAYER)), str(plan.frames or "")
        return [player, *player_arguments(plan, config, str(plan.system_folder), frames)]

    @staticmethod
    def _environment_of(plan: NodePlan) -> dict[str, str] | None:
        if plan.runtime is None:
            return None
        config = str(plan.run_dir.resolve() / config_name(plan))
        return environment(plan, str(clients_folder()), host_path(), config, str(plan.frames or ""))

    def _launch(self, plan: NodePlan, dead: LocalNode | None) -> LocalNode:
        network_fd = -1
        if plan.host_network:
            network_fd = os.open(netns(os.getpid()), os.O_RDONLY)
        elif dead is not None:
            network_fd = os.open(dead.namespace, os.O_RDONLY)
        paths = self._groups.make(f"{plan.run_key}-{plan.role}", plan.limits, plan.cpus)
        ready_read, ready_write = os.pipe()
        role_dir = plan.run_dir / plan.role
        role_dir.mkdir(parents=True, exist_ok=True)
        os.chown(role_dir, NODE_UID, NODE_UID)
        start = self._launcher(ready_write, network_fd, paths, plan.limit_bytes)
        command = [*start, *self._program_of(plan)]
        try:
            with (role_dir / "log.txt").open("wb" if dead is None else "ab") as log:
                process = subprocess.Popen(
                    command,
                    stdin=subprocess.PIPE,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    pass_fds=[fd for fd in (ready_write, network_fd) if fd >= 0],
                    cwd="/",
                    env=self._environment_of(plan),
                    # Ctrl-C reaches only the harness, which ends the nodes in its own order.
                    start_new_session=True,
                )
            os.close(ready_write)
            ready_write = -1
            own = plan.runtime is not None
            node = LocalNode(plan.role, process, paths, several_processes=own)
            log_file = role_dir / "log.txt"
            if (problem := _problem_at_barrier(ready_read, node, log_file)) is not None:
                node.remove()
                raise problem
            if dead is not None and not plan.host_network:
                node.take_over_namespace(dead)
            return node
        finally:
            for fd in (ready_read, ready_write, network_fd):
                if fd >= 0:
                    os.close(fd)


def _problem_at_barrier(ready: int, node: LocalNode, log: Path) -> SlambedError | None:
    """Returns why a node did not reach the start barrier. Slowness or a kill may be temporary; a
    refusal by the kernel is not."""
    line = f"the {node.role} node did not reach the start barrier"
    if not select.select([ready], [], [], BARRIER_TIMEOUT_S)[0]:
        return PassingError(f"{line} within {BARRIER_TIMEOUT_S:.0f} s")
    if os.read(ready, 1) == b"r":
        return None
    code = node.wait()
    if ended_from_outside(code):
        return KilledError(f"{line}: it was killed ({ending(code)})")
    return environment_error(f"{line}: {last_line(log)}")
