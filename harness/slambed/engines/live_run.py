# SPDX-License-Identifier: Apache-2.0
"""One live run: both nodes up to the start barrier, the link, start, watch, stop."""

import json
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Protocol, cast

from slambed.engines import segmenter
from slambed.engines.base import (
    EDGE_CONFIG,
    Engine,
    Node,
    NodePlan,
    Sidecar,
    differences,
    last_line,
    thread_invalid_reasons,
)
from slambed.engines.faults import FaultDriver, RunEdge
from slambed.engines.node_ends import at_start_barrier, from_outside, how_it_died, node_report
from slambed.engines.result import (
    InterruptedRunError,
    Outcome,
    RunResult,
    run_config,
    time_limit_s,
)
from slambed.engines.segmenter_keeper import SegmenterKeeper
from slambed.engines.written_bytes import TooManyBytesError, WrittenBytes
from slambed.errors import ExitCode, KilledError, PassingError
from slambed.link.facts import LinkFacts
from slambed.process.cpus import own_cpus
from slambed.process.endings import ending
from slambed.records.run_config import PacedDevice, PacedDevices, RunConfig
from slambed.sampling.record import (
    AskedLimits,
    GrantedLimits,
    MeasuredSpeed,
    NodeLimits,
    Throttling,
)
from slambed.spec.device import Device, Limits
from slambed.spec.host_speed import UNKNOWN, HostSpeed
from slambed.spec.run_spec import RunSpec
from slambed.spec.system import Role

READY_TIMEOUT_S = 30.0
WATCH_PERIOD_S = 0.02
# Time for the edge to finish mapping and write its files after BYE.
EDGE_GRACE_S = 20.0
STOP_GRACE_S = 10.0


class OpenLink(Protocol):
    """The link between the namespaces of the two nodes during a run."""

    def start(self, t0_ns: int) -> None: ...
    def alive(self) -> bool: ...
    def stop(self) -> LinkFacts: ...


LinkOpener = Callable[[RunSpec, Path, Path, Path, float], OpenLink]
"""(run, mobile namespace, edge namespace, log folder, longest duration [s]) -> an open link."""


class LiveRun:
    """Executes one RunSpec in `run_dir` and leaves its raw files there."""

    def __init__(
        self,
        spec: RunSpec,
        engine: Engine,
        sequence: Path,
        played_s: float,
        run_dir: Path,
        open_link: LinkOpener,
        stop: threading.Event,
        host: HostSpeed = UNKNOWN,
        frames: Path | None = None,
    ) -> None:
        """`frames`: recorded folder for a system that reads one."""
        self._spec = spec
        self._engine = engine
        self._sequence = sequence
        self._limit_s = time_limit_s(spec, played_s, engine.start_ahead_s)
        self._run_dir = run_dir
        self._written = WrittenBytes(run_dir, spec.max_run_mb)
        self._open_link = open_link
        self._stop = stop
        self._host = host
        self._frames = frames
        self._devices: dict[Role, Device] = {"mobile": spec.device_mobile}
        if spec.device_edge is not None:
            self._devices["edge"] = spec.device_edge
        self._host_cpus = own_cpus()
        self._limits: dict[Role, Limits] = {}
        self._cpus: dict[Role, list[int]] = {}
        self._nodes: dict[Role, Node] = {}
        self._plans: dict[Role, NodePlan] = {}
        self._link: OpenLink | None = None
        self._segmenter: SegmenterKeeper | None = None
        self._mobile_seen_ns = 0
        """Time at which the mobile node was last seen running."""
        self._invalid_reasons: list[str] = []
        """Why the circumstances are not as configured."""

    def execute(self) -> RunResult:
        """Executes the run. A node that dies or refuses its input is an outcome; a failure to
        start is an error."""
        config, own = self._config("mobile"), self._config("edge")
        self._limits = {
            role: device.limits_on(self._host.speed, len(self._host_cpus))
            for role, device in self._devices.items()
        }
        if self._spec.paced:
            pace = {"pace": paced_devices(self._devices, self._limits)}
            config, own = config.model_copy(update=pace), own.model_copy(update=pace)
        if self._spec.masks is not None:
            own = own.model_copy(update={"segmenter": segmenter.config(own.output)})
        config = config.without(self._spec.edge_inputs)
        if own != config:
            (self._run_dir / EDGE_CONFIG).write_text(json.dumps(own.as_json(), indent=1))
        (self._run_dir / "run.json").write_text(json.dumps(config.as_json(), indent=1))
        with ExitStack() as cleanup:
            limits = self._start_nodes(cleanup)
            self._start_segmenter(cleanup)
            with at_start_barrier(self._nodes):
                sidecar = self._engine.start_sidecar(
                    self._nodes,
                    self._limits,
                    self._cpus,
                    self._run_dir,
                    whole_groups=self._spec.runtime is not None,
                )
            cleanup.callback(sidecar.close)
            edge = RunEdge(self._engine, self._plans.get("edge"), self._nodes, sidecar, cleanup)
            faults = FaultDriver(self._spec.faults, edge, self._run_dir)
            if self._spec.link is not None:
                log_dir = self._run_dir / "link"
                log_dir.mkdir()
                with at_start_barrier(self._nodes):
                    self._link = self._open_link(
                        self._spec,
                        self._nodes["mobile"].namespace,
                        self._nodes["edge"].namespace,
                        log_dir,
                        self._limit_s + EDGE_GRACE_S,
                    )
                cleanup.callback(self._close_link)
            for node in self._nodes.values():
                node.release()
            if (ended := self._await_ready()) is not None:
                self._written.cut()
                return RunResult(*ended, invalid_reasons=self._invalid_reasons, limits=limits)
            faults.start(t0_ns := self._start_clock(sidecar))
            outcome, reason = self._watch(faults)
            faults.write()
            self._invalid_reasons += faults.invalid_reasons
            observed = sidecar.stop()
            link = self._close_link()
            sidecar_use = observed.own
            if self._segmenter is not None:
                took = {"segmenter_cpu_s": self._segmenter.close()}
                sidecar_use = sidecar_use.model_copy(
                    update=took | {"segmenter_restarts": self._segmenter.restarts}
                )
            for role, threads in observed.threads.items():
                limits[role] = limits[role].model_copy(update={"threads": threads})
                self._invalid_reasons += thread_invalid_reasons(
                    role, threads, self._limits[cast(Role, role)]
                )
            if link is not None and link.invalid_reason:
                self._invalid_reasons.append(f"link: {link.invalid_reason}")
        if self._stop.is_set():
            raise InterruptedRunError
        self._written.cut()
        return RunResult(
            outcome=outcome,
            reason=reason,
            invalid_reasons=self._invalid_reasons,
            limits=limits,
            throttling={
                node: Throttling(
                    throttled_s=usage.throttled_s,
                    throttled_periods=usage.throttled_periods,
                    periods=usage.periods,
                )
                for node, usage in observed.usage.items()
            },
            link=link,
            sidecar=sidecar_use,
            board=self._engine.board_facts(),
            mobile_until_s=(self._mobile_seen_ns - t0_ns) / 1e9,
        )

    def _start_nodes(self, cleanup: ExitStack) -> dict[str, NodeLimits]:
        devices = self._devices
        self._cpus = cpus = self._engine.allot(self._limits)
        limits: dict[str, NodeLimits] = {}
        # The edge first, so that it is listening when the mobile node connects.
        for role in sorted(cpus):
            asked = self._limits[role]
            dies = role == "edge" and any(fault.edge == "kill" for fault in self._spec.faults)
            key, own = self._spec.run_key, cpus[role]
            runtime, folder = self._spec.runtime, Path(self._spec.system_folder)
            plan = NodePlan(
                role,
                key,
                self._run_dir,
                self._sequence,
                asked,
                own,
                dies,
                runtime,
                folder,
                self._frames,
                self._written.limit_bytes,
            )
            node = self._engine.start(plan)
            cleanup.callback(node.remove)
            self._nodes[role], self._plans[role] = node, plan
            measured = MeasuredSpeed(**asdict(self._host)) if devices[role].board else None
            limits[role] = NodeLimits(
                asked=AskedLimits(**asked.model_dump(), cpus=cpus[role]),
                granted=GrantedLimits(**asdict(node.granted)),
                shortfall=devices[role].shortfall(asked, self._host.speed),
                host_speed=measured,
            )
            granted = differences(asked, node.granted, cpus[role])
            self._invalid_reasons += [f"{role}: {text}" for text in granted]
        return limits

    def _start_segmenter(self, cleanup: ExitStack) -> None:
        """Starts the segmenter and waits until it is ready, before a node passes the start
        barrier. It ends before the edge's cgroups are removed."""
        masks = self._spec.masks
        if masks is None:
            return
        keeper = SegmenterKeeper(
            lambda: self._engine.start_segmenter(
                self._plans["edge"], self._nodes["edge"], masks.network
            )
        )
        self._segmenter = keeper
        cleanup.callback(keeper.close)
        keeper.await_ready(self._stop.is_set)

    def _await_ready(self) -> tuple[Outcome, str] | None:
        """Returns None once all nodes are ready, otherwise how one of them ended before."""
        try:
            return self._ended_unready()
        except TooManyBytesError as error:
            self._end_nodes()
            return "died", str(error)

    def _ended_unready(self) -> tuple[Outcome, str] | None:
        runtime = self._spec.runtime
        patience_s = READY_TIMEOUT_S if runtime is None else runtime.ready_s
        deadline = time.monotonic() + patience_s
        waiting = set(self._nodes)
        while waiting:
            waiting = {r for r in waiting if not (self._run_dir / r / "ready.json").exists()}
            for role, node in self._nodes.items():
                if (code := node.exit_code()) is not None:
                    return self._refused(role, code)
            if self._stop.is_set():
                raise InterruptedRunError
            self._written.watch()
            if self._link is not None and not self._link.alive():
                raise PassingError("the link ended before the run began")
            if time.monotonic() > deadline:
                names = " and ".join(sorted(waiting))
                raise PassingError(
                    f"the {names} node was not ready within {patience_s:.0f} s", ExitCode.PEER
                )
            time.sleep(WATCH_PERIOD_S / 2)
        return None

    def _refused(self, role: Role, code: int) -> tuple[Outcome, str]:
        self._written.look()
        if (how := from_outside(self._nodes[role], code, self._run_dir)) is not None:
            raise KilledError(f"the {role} node {how} before it was ready")
        last_words = last_line(self._run_dir / role / "log.txt").removeprefix("error: ")
        line = f"the {role} node ended before it was ready ({ending(code)}): {last_words}"
        if code in (ExitCode.ENVIRONMENT, ExitCode.PEER):
            raise PassingError(line, ExitCode(code))
        return ("refused" if code == ExitCode.BAD_INPUT else "died"), line

    def _config(self, role: Role) -> RunConfig:
        """Returns the configuration with paths as this node sees them."""
        engine = self._engine
        return run_config(
            self._spec,
            engine.sequence_path(self._sequence, role),
            engine.output_path(self._run_dir, role),
            self._limit_s,
            engine.edge_address,
        )

    def _start_clock(self, sidecar: Sidecar) -> int:
        """Starts the run clock; returns run time 0 on CLOCK_MONOTONIC."""
        t0_ns = time.monotonic_ns() + int(self._engine.start_ahead_s * 1e9)
        if self._link is not None:
            self._link.start(t0_ns)
        sidecar.start(t0_ns)
        self._engine.send_start(self._run_dir, t0_ns)
        return t0_ns

    def _watch(self, faults: FaultDriver) -> tuple[Outcome, str | None]:
        """Watches until the run has ended, and ends its nodes."""
        try:
            ended = self._until_ended(faults)
            self._end(faults)
            self._written.look()
        except TooManyBytesError as error:
            self._end(faults)
            return "died", str(error)
        except InterruptedRunError:
            self._end(faults)
            raise
        return ended

    def _until_ended(self, faults: FaultDriver) -> tuple[Outcome, str | None]:
        """Returns how the mobile node ended. A dead edge or link does not end the run: the behavior
        of the mobile node is the result."""
        deadline = time.monotonic() + self._limit_s
        ended: tuple[Outcome, str] | None = None
        link_died = False
        mobile = self._nodes["mobile"]
        while (code := mobile.exit_code()) is None:
            self._mobile_seen_ns = time.monotonic_ns()
            faults.act()
            edge = self._nodes.get("edge")
            if self._segmenter is not None and edge is not None:
                self._segmenter.act(faults.note, edge.exit_code() is None)
            if self._stop.wait(faults.wait_s(WATCH_PERIOD_S)):
                raise InterruptedRunError
            self._written.watch()
            if time.monotonic() > deadline:
                return "timed_out", f"not finished after {self._limit_s:.0f} s"
            missed = ended is None and not faults.edge_is_dead
            if missed and edge is not None and self._ended_early(edge):
                ended = self._died("edge", edge.exit_code() or 0)
            if not link_died and self._link is not None and not self._link.alive():
                link_died = True
                self._invalid_reasons.append("the link ended in the middle of the run")
        faults.finish()
        if code != 0 or from_outside(mobile, code, self._run_dir):
            return self._died("mobile", code)
        edge = self._nodes.get("edge")
        if edge is not None and ended is None and not faults.edge_is_dead:
            ended = self._await_edge(edge)
        return ended or ("completed", None)

    def _ended_early(self, edge: Node) -> bool:
        """Returns whether the edge failed. An edge that exits normally has received BYE, so the
        mobile node is about to end too."""
        if (code := edge.exit_code()) is None:
            return False
        # Without a report it was stopped from outside.
        return code != 0 or node_report(edge, self._run_dir).stopped is not False

    def _await_edge(self, edge: Node) -> tuple[Outcome, str] | None:
        deadline = time.monotonic() + EDGE_GRACE_S
        while (code := edge.exit_code()) is None:
            if self._stop.wait(WATCH_PERIOD_S):
                raise InterruptedRunError
            self._written.watch()
            if time.monotonic() > deadline:
                return (
                    "timed_out",
                    f"the edge node went on {EDGE_GRACE_S:.0f} s after the mobile node",
                )
        if code != 0 or from_outside(edge, code, self._run_dir):
            return self._died("edge", code)
        return None

    def _died(self, role: Role, code: int) -> tuple[Outcome, str]:
        """Returns the outcome; marks the run invalid if the end was caused from outside."""
        self._written.look()
        node = self._nodes[role]
        if (how := from_outside(node, code, self._run_dir)) is not None:
            self._invalid_reasons.append(f"the {role} node {how}")
        return "died", how_it_died(node, code, self._run_dir)

    def _end(self, faults: FaultDriver) -> None:
        """Ends the nodes once the faults are over: a frozen node could not stop by itself."""
        faults.finish()
        self._end_nodes()

    def _end_nodes(self) -> None:
        for node in self._nodes.values():
            if node.exit_code() is None:
                node.ask_to_stop()
        deadline = time.monotonic() + STOP_GRACE_S
        for node in self._nodes.values():
            while node.exit_code() is None and time.monotonic() < deadline:
                time.sleep(WATCH_PERIOD_S)
            node.kill()

    def _close_link(self) -> LinkFacts | None:
        if self._link is None:
            return None
        link, self._link = self._link, None
        return link.stop()


def paced_devices(devices: Mapping[Role, Device], limits: Mapping[Role, Limits]) -> PacedDevices:
    """Returns each node's device, and the share of a host CPU that equals one of its cores under
    its limits."""
    found: dict[str, PacedDevice] = {}
    for role, device in devices.items():
        assert device.model is not None  # checked when the device was chosen
        found[role] = PacedDevice(share=device.share_on(limits[role]), device=device.model)
    return PacedDevices.model_validate(found)
