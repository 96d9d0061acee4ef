# SPDX-License-Identifier: Apache-2.0
"""A campaign of short runs with seeded random faults: called again until it is done, then
checked."""

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, get_args

import chaos_faults as faults
import psutil
from chaos_checks import (
    ENDS_WITHIN_S,
    problems_of_bytes,
    problems_of_host,
    problems_of_results,
)
from chaos_clock import Clock
from chaos_cluster import Cluster
from chaos_daemon import DAEMON_ERRORS, Daemon
from chaos_faults import CLOCK, IN_DOCKER, KILL, ON_DISK, STOP, TERMINATE, Disk, Fault
from chaos_instants import Instants
from chaos_user import User

from slambed.campaign.folder import ResultFolder
from slambed.engines import sidecar
from slambed.engines.helper import container_role
from slambed.engines.lock_file import default_lock_path
from slambed.errors import ExitCode
from slambed.link import link_helper
from slambed.spec.system import Role

COMMAND = "from slambed.commands.main import main; main()"
MOST_HELD_S = 1.5
"""Maximum duration of a stop or a disk fault."""
MOST_WORKERS = 3
EARLY = 0.15
"""Share of calls that may meet a fault before they execute runs."""
LEAST_JUMP_S, MOST_JUMP_S = 60.0, 120.0
CLOCK_ERROR_MS = 50.0
"""Tolerance of the clock after it was changed and restored on a busy host."""
HANGS_S = 1200.0
LOOK_EVERY_S = 0.01
EXPECTED = {ExitCode.NOT_ALL_GOOD, ExitCode.ENVIRONMENT, 130, -signal.SIGKILL, -signal.SIGTERM}
"""Exit codes allowed after faults."""
ALWAYS: list[tuple[Fault, int]] = [
    (Fault(KILL, "harness"), 3),
    (Fault(TERMINATE, "harness"), 1),
    (Fault(STOP, "harness"), 1),
    *((Fault(act), 1) for act in ON_DISK),
]
BESIDE_NODES: list[tuple[Fault, int]] = [
    *((Fault(KILL, role), 3) for role in ("mobile node", "edge node", "relay", "sampler")),
    *((Fault(STOP, role), 1) for role in ("mobile node", "edge node", "relay", "sampler")),
    *((Fault(TERMINATE, role), 1) for role in ("mobile node", "edge node")),
]
NODES = get_args(Role)
SIDECAR, LINK_HELPER = (container_role(module.__name__) for module in (sidecar, link_helper))
"""Roles of the containers that `slambed.engines.helper` starts."""
OF_KIND: dict[str, list[tuple[Fault, int]]] = {
    "virtual": [
        (Fault(KILL, "worker"), 12),
        (Fault(KILL, "node"), 12),
        (Fault(KILL, "fork server"), 2),
        (Fault(KILL, "resource tracker"), 1),
        (Fault(STOP, "worker"), 3),
        (Fault(STOP, "node"), 3),
    ],
    "dask": [
        (Fault(KILL, "Dask worker"), 5),
        (Fault(KILL, "Dask scheduler"), 1),
        (Fault(KILL, "node"), 4),
        (Fault(STOP, "Dask worker"), 2),
        (Fault(STOP, "node"), 1),
    ],
    "live": BESIDE_NODES,
    "docker": [
        *BESIDE_NODES,
        (Fault(KILL, "helper container"), 3),
        (Fault(STOP, "helper container"), 1),
        (Fault(KILL, "docker client"), 1),
        *((Fault("docker kill", role), 1) for role in (*NODES, LINK_HELPER, SIDECAR)),
        *((Fault("docker pause", role), 1) for role in (*NODES, LINK_HELPER)),
        *((Fault("docker rm", role), 1) for role in (*NODES, SIDECAR)),
        (Fault(TERMINATE, "dockerd"), 2),
        (Fault(KILL, "dockerd"), 2),
        (Fault(STOP, "dockerd"), 2),
        (Fault(KILL, "containerd"), 1),
    ],
}


@dataclass(frozen=True)
class Torment:
    """The faults of one campaign."""

    kind: str
    seed: int
    jobs: int
    faults: int
    every_s: float
    """Mean time between faults; on a fast host they come earlier (chaos_instants.py)."""
    figures: bool = True
    """Whether reports include figures, which take most of the CPU time in a campaign of short
    runs."""
    only: tuple[str, ...] = ()
    """Only these faults; default: all of the kind."""
    clock: bool = False
    """Whether the host's time of day may also jump."""
    unprivileged: bool = False
    """Runs as a user without root privileges."""


@dataclass
class Outcome:
    """The result."""

    torment: Torment
    struck: list[str] = field(default_factory=list)
    calls: list[list[Any]] = field(default_factory=list)
    """Exit code and last line of each call of the command."""
    problems: list[str] = field(default_factory=list)
    took_s: float = 0.0

    def line(self) -> str:
        """Formats it as one line of a log."""
        return json.dumps(asdict(self))


@dataclass
class Campaign:
    """An experiment, its folder, and the command to call."""

    place: Path
    experiment: Path
    torment: Torment
    own_disk: bool
    reference: dict[str, str] | None = None
    more: list[str] = field(default_factory=list)
    """Further arguments of the command."""
    daemon: Daemon | None = None
    """Docker daemon of the containers."""
    user: User | None = None
    """User that calls the command; None: the current user."""

    def __post_init__(self) -> None:
        t = self.torment
        self.token = f"{os.getpid()}-{t.kind}-{t.seed}"
        self.folder = self.place / f"{t.kind}-{t.seed}"
        self.folder.mkdir()
        (self.folder / "tmp").mkdir()
        self.disk = Disk(self.folder / "results", self.own_disk)
        seed = f"chaos/{t.kind}/{t.seed}/{t.jobs}"
        self.rng = random.Random(seed)
        self._instants = Instants(seed, t.every_s)
        self.out = Outcome(t)
        self._held: list[tuple[float, str, Callable[[], None]]] = []
        """(end, kind, function) of current faults of disk, clock or a process."""
        self._clock = Clock()
        self._log = self.folder / "log.txt"
        self._pids: list[int] = []
        self._cluster: Cluster | None = None
        if t.kind == "dask":
            # A killed scheduler's leftovers are not slambed's, which only knows its address.
            own = self.folder / "cluster-tmp"
            own.mkdir()
            environment = self.environment() | {"TMPDIR": str(own)}
            self._cluster = Cluster(self.folder, environment, min(t.jobs, MOST_WORKERS))
            self.more = [*self.more, "--scheduler", self._cluster.address]
        if self.user is not None:
            for path in (self.folder, self.folder / "tmp", self.disk.folder):
                self.user.own(path)

    def environment(self) -> dict[str, str]:
        """Environment of all processes of this campaign."""
        own = {faults.TOKEN: self.token, "TMPDIR": str(self.folder / "tmp"), "SLAMBED_DEBUG": "1"}
        if self.daemon is not None:
            own |= self.daemon.environment
        if self.user is not None:
            own |= {"HOME": str(self.folder), "SLAMBED_CACHE": str(self.place / "cache-user")}
        return {**os.environ, **own}

    def play(self) -> Outcome:
        """Calls the command with faults until it is done, then checks the results."""
        began_s = time.monotonic()
        calm = 0
        try:
            while calm < 2:
                before = len(self.out.struck)
                code = self._call()
                if code == ExitCode.OK:
                    break
                calm = calm + 1 if len(self.out.struck) == before else 0
                if calm and code not in (ExitCode.NOT_ALL_GOOD, ExitCode.ENVIRONMENT):
                    self.out.problems.append(f"exit code {code} without a fault")
            else:
                self.out.problems.append(f"not done: {self.out.calls[-1]}")
            if self._cluster is not None:
                self._cluster.close()
            self._look()
        finally:
            if self._cluster is not None:
                self._cluster.close()
            self._let_go(everything=True)
            for process in self._alive():
                process.kill()
            self.disk.remove()
        self.out.took_s = round(time.monotonic() - began_s, 1)
        return self.out

    def _alive(self) -> list[psutil.Process]:
        group = self.daemon.cgroup if self.daemon is not None else ""
        return faults.processes(self.token, group)

    def _look(self) -> None:
        if self.daemon is not None:
            self.daemon.ready()
        if self.torment.clock and abs(error_ms := self._clock.error_ms()) > CLOCK_ERROR_MS:
            self.out.problems.append(f"the clock is {error_ms:.0f} ms off")
        results = ResultFolder(self.disk.folder / self.experiment.stem)
        if not results.path.is_dir():
            self.out.problems.append("no results")
            return
        keys = results.run_keys()
        self.out.problems += problems_of_results(results)
        if self.reference is not None:
            self.out.problems += problems_of_bytes(results, self.reference)
        locks = [results.path / ".lock", default_lock_path()]
        empty = self.folder / "tmp"
        self.out.problems += problems_of_host(
            self.token, locks, self._pids, keys, empty, self.daemon
        )

    def _call(self) -> int:
        user = self.user
        python = sys.executable if user is None else user.python
        command = [python, "-c", COMMAND, "run", str(self.experiment), *self.more]
        command += ["--results", str(self.disk.folder)]
        command += ["--figures" if self.torment.figures else "--no-figures"]
        self._log.unlink(missing_ok=True)
        with self._log.open("a") as log:
            process = subprocess.Popen(
                command,
                env=self.environment(),
                stdout=log,
                stderr=subprocess.STDOUT,
                cwd=self.folder,
                start_new_session=True,
                user=user.uid if user else None,
                group=user.gid if user else None,
                extra_groups=[] if user else None,
            )
        self._pids.append(process.pid)
        # Some faults hit the start of a call; most come once it executes runs, however slow the
        # host is.
        early = self.rng.random() < EARLY
        began_ns, last_s = time.time_ns(), time.monotonic()
        self._instants.call(self._entries())
        while (code := process.poll()) is None:
            self._let_go()
            now_s = time.monotonic()
            if early or self._executes_since(began_ns):
                self._instants.executes(now_s)
            more = len(self.out.struck) < self.torment.faults
            if more and self._instants.due(now_s, self._entries()):
                struck = self._strike(process.pid)
                self._instants.drawn(now_s, struck)
                if struck:
                    last_s = now_s
            if now_s - last_s > HANGS_S:
                self.out.problems.append(f"hangs: {self._last_line()}")
                process.kill()
                process.wait(ENDS_WITHIN_S)
            time.sleep(LOOK_EVERY_S)
        self._let_go(everything=self.rng.random() < 0.5)
        self.out.calls.append([code, self._last_line()])
        self._judge(code)
        return code

    def _executes_since(self, began_ns: int) -> bool:
        plan = self.disk.folder / self.experiment.stem / "experiment.json"
        try:
            return plan.stat().st_mtime_ns > began_ns
        except OSError:
            return False

    def _entries(self) -> int:
        """Number of run entries in the ledger: the progress of the campaign."""
        try:
            ledger = (self.disk.folder / self.experiment.stem / "ledger.jsonl").read_bytes()
        except OSError:
            return 0
        return ledger.count(b'"event": "run_')

    def _judge(self, code: int) -> None:
        text = self._log.read_text(errors="replace")
        if code != ExitCode.OK and code not in EXPECTED:
            self.out.problems.append(f"exit code {code}: {text[-2000:]}")
        if code in (ExitCode.NOT_ALL_GOOD, ExitCode.ENVIRONMENT) and "\nerror: " not in f"\n{text}":
            self.out.problems.append(f"exit code {code} without its line: {text[-500:]}")
        for word in ("Traceback", "a bug of slambed"):
            if word in text:
                self.out.problems.append(f"{word}: {text[max(0, text.index(word) - 200) :][:2500]}")

    def _last_line(self) -> str:
        lines = self._log.read_text(errors="replace").strip().splitlines() or [""]
        return ([line for line in lines if line.startswith("error: ")] or lines)[-1][:300]

    def _strike(self, harness: int) -> bool:
        """Injects a fault of this kind; False if it has no target now."""
        choices = ALWAYS + OF_KIND[self.torment.kind]
        if self.torment.clock:
            choices += [(Fault(act), 3) for act in CLOCK]
        if self.torment.only:
            choices = [c for c in choices if str(c[0]) in self.torment.only]
        (fault,) = self.rng.choices([c[0] for c in choices], [c[1] for c in choices])
        until_s = time.monotonic() + self.rng.uniform(0.1, MOST_HELD_S)
        how = self._strike_process
        if fault.act in ON_DISK or fault.act in CLOCK:
            if any(kind == fault.act for _, kind, _ in self._held):
                return False
            how = self._strike_disk if fault.act in ON_DISK else self._strike_clock
        elif fault.act in IN_DOCKER:
            how = self._strike_container
        if not how(fault, harness, until_s):
            return False
        self.out.struck.append(str(fault))
        return True

    def _strike_disk(self, fault: Fault, harness: int, until_s: float) -> bool:
        if any(kind in ON_DISK for _, kind, _ in self._held):
            return False
        if not self.disk.strike(fault.act, self.rng):
            self.disk.heal()
            return False
        self._held.append((until_s, fault.act, self.disk.heal))
        return True

    def _strike_clock(self, fault: Fault, harness: int, until_s: float) -> bool:
        seconds = self.rng.uniform(LEAST_JUMP_S, MOST_JUMP_S)
        if not self._clock.jump(seconds if fault.act == "clock forward" else -seconds):
            return False
        self._held.append((until_s, fault.act, self._clock.restore))
        return True

    def _strike_container(self, fault: Fault, harness: int, until_s: float) -> bool:
        assert self.daemon is not None
        container = self.daemon.container(fault.target)
        if container is None:
            return False
        try:
            if fault.act == "docker kill":
                container.kill()
            elif fault.act == "docker rm":
                container.remove(force=True)
            else:
                container.pause()
                self._held.append((until_s, fault.act, lambda: _unpause(container)))
        except DAEMON_ERRORS:
            return False
        return True

    def _strike_process(self, fault: Fault, harness: int, until_s: float) -> bool:
        victim = self.daemon.processes().get(fault.target) if self.daemon is not None else None
        if victim is None:
            victim = faults.strike(fault, self._alive(), harness, self.rng)
        elif not faults.signal_to(victim, fault.act):
            return False
        if victim is not None and fault.act == STOP:
            self._held.append((until_s, fault.act, lambda: faults.wake(victim)))
        return victim is not None

    def _let_go(self, everything: bool = False) -> None:
        """Ends faults whose time is over."""
        now_s = time.monotonic()
        for item in list(self._held):
            until_s, _, release = item
            if everything or until_s <= now_s:
                release()
                self._held.remove(item)


def _unpause(container: Any) -> None:
    with contextlib.suppress(*DAEMON_ERRORS):
        container.unpause()
