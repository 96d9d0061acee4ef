# SPDX-License-Identifier: Apache-2.0
"""Samples cgroups, threads and TCP connections of the nodes of a run, in run time."""

import contextlib
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TextIO

import psutil

from slambed.sampling.cgroup import CgroupReader, Usage, paths_of
from slambed.sampling.record import Sample
from slambed.sampling.tasks import Pressure, RunQueueDelay
from slambed.sampling.tcp_info import TcpWatch

NS_PER_S = 1_000_000_000

Throttling = Callable[[], tuple[float, int]]
"""Returns seconds and periods of throttling in cgroups below the node's own."""


@dataclass
class NodeWatch:
    """The sources that are read for one node."""

    name: str
    reader: CgroupReader
    run_queue: RunQueueDelay
    pressure: Pressure
    tcp: TcpWatch | None = None
    below: Throttling | None = None
    earlier: Usage | None = None
    """Final counters of a cgroup that was removed with its process."""
    seen: Usage | None = None
    """The last counters, with those of `earlier`."""
    counted_s: float = 0.0
    """The last CPU time of the cgroup itself."""

    def follow(self, pid: int) -> None:
        """Switches to a new process of the node. If its cgroup is new, the old counters are
        added."""
        self.reader.close()
        self.reader = CgroupReader(paths_of(pid))
        self.run_queue.follow(pid)
        self.usage()

    def usage(self) -> Usage:
        """Returns the current counters, including nested cgroups. Raises OSError when the cgroup
        is gone."""
        usage = self.reader.usage()
        if usage.cpu_s < self.counted_s:
            # A new cgroup. It may have the path of the old one, and be read before `follow`.
            self.earlier = self.seen
        self.counted_s = usage.cpu_s
        if self.earlier is not None:
            usage = replace(
                usage,
                cpu_s=usage.cpu_s + self.earlier.cpu_s,
                throttled_s=usage.throttled_s + self.earlier.throttled_s,
                throttled_periods=usage.throttled_periods + self.earlier.throttled_periods,
                periods=usage.periods + self.earlier.periods,
            )
        self.seen = usage
        if self.below is None:
            return usage
        seconds, periods = self.below()
        return replace(
            usage,
            throttled_s=usage.throttled_s + seconds,
            throttled_periods=usage.throttled_periods + periods,
        )


def host_steal_s() -> float | None:
    """Returns the CPU time since boot, over all CPUs of this host, that the hypervisor gave to
    other guests; None where the kernel does not report it."""
    steal: float | None = getattr(psutil.cpu_times(), "steal", None)
    return steal


class Sampler:
    """Writes one line per node and sample (docs/reference/samples.md)."""

    def __init__(self, nodes: list[NodeWatch], out: TextIO) -> None:
        self._nodes = nodes
        self._out = out
        self._last: dict[str, tuple[int, Usage]] = {}
        self.samples = 0

    def last(self) -> dict[str, Usage]:
        """Returns the newest counters of each node."""
        return {node: usage for node, (_, usage) in self._last.items()}

    def sample(self, t0_ns: int) -> None:
        """Takes one sample of every node; run time = CLOCK_MONOTONIC - t0_ns."""
        self.samples += 1
        steal_s = host_steal_s()
        for node in self._nodes:
            # The cgroup is gone once its node has ended.
            with contextlib.suppress(OSError):
                self._sample(node, t0_ns, steal_s)

    def _sample(self, node: NodeWatch, t0_ns: int, steal_s: float | None) -> None:
        now_ns = time.monotonic_ns()
        usage = node.usage()
        before = self._last.get(node.name)
        percent: float | None = None
        if before is not None and now_ns > before[0]:
            percent = 100 * (usage.cpu_s - before[1].cpu_s) / ((now_ns - before[0]) / NS_PER_S)
        self._last[node.name] = (now_ns, usage)
        tcp = node.tcp.read() if node.tcp is not None else None
        row = Sample(
            t_s=(now_ns - t0_ns) / NS_PER_S,
            node=node.name,
            cpu_s=usage.cpu_s,
            cpu_percent=percent,
            memory_mb=usage.memory_bytes / 2**20,
            throttled_s=usage.throttled_s,
            throttled_periods=usage.throttled_periods,
            run_delay_s=node.run_queue.seconds(),
            cpu_pressure_s=node.pressure.seconds(),
            host_steal_s=steal_s,
            tcp_rtt_ms=tcp.rtt_ms if tcp is not None else None,
            tcp_retransmits=tcp.retransmits if tcp is not None else None,
        )
        self._out.write(json.dumps(vars(row)) + "\n")
