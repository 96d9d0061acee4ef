# SPDX-License-Identifier: Apache-2.0
"""Records about the nodes of a run: samples, and the limits and sampler facts in the manifest."""

from dataclasses import dataclass

from slambed.files.json_file import Record


@dataclass(frozen=True)
class Sample:
    """A row of samples.jsonl and samples.parquet: one node at one time. A virtual run has only the
    first four values; the others are null there."""

    t_s: float
    """Run time: CLOCK_MONOTONIC minus t0."""
    node: str
    """`mobile` or `edge`."""
    cpu_s: float
    """Cumulative."""
    cpu_percent: float | None
    """Percent of one core, since the previous sample."""
    memory_mb: float
    """Anonymous memory: heap and stacks, without mapped files such as libraries and the
    sequence."""
    throttled_s: float
    """Cumulative, over the cgroups of the node and of its threads; threads that are throttled at
    the same time each count."""
    throttled_periods: int
    """Number of throttled periods, counted like `throttled_s`."""
    run_delay_s: float | None
    """Cumulative time in which threads were runnable but not running, over all threads; includes
    throttling on most kernels."""
    cpu_pressure_s: float | None
    """Cumulative PSI "some" of the node's cgroup on v2, otherwise of the host; null without PSI."""
    host_steal_s: float | None
    """Cumulative, over all CPUs of the host: time that its hypervisor gave to other guests."""
    tcp_rtt_ms: float | None
    """Mobile node: tcpi_rtt of the connection with the most recent ACK; null without a
    connection."""
    tcp_retransmits: int | None
    """Mobile node: TCP retransmissions of all connections; null without a connection."""


class ThreadCap(Record):
    """CPU cap of one thread of a node."""

    name: str
    """Name that the thread gave itself."""
    cores: float | None
    """Read back from the kernel; null: no cap."""
    period_ms: float
    """Quota period, read back from the kernel."""
    throttled_s: float
    """Cumulative, at the end of the run."""
    throttled_periods: int
    """Throttled periods at the end of the run."""


class AskedLimits(Record):
    """Limits of a node as derived from its device (catalog/devices/*.yaml); null: none."""

    cores: int | None = None
    """Number of host CPUs that it may run on."""
    quota_cores: float | None = None
    """CPU seconds per second, over all threads."""
    thread_cores: float | None = None
    """CPU seconds per second of each single thread."""
    period_ms: float | None = None
    """Length of a quota period."""
    memory_mb: int | None = None
    """Page cache included."""
    cpus: list[int] | None = None
    """Numbers of those CPUs."""


class GrantedLimits(Record):
    """Limits as the kernel reports them; null: none."""

    cpus: str | None = None
    """List in the kernel's format: `0-2,5`."""
    quota_cores: float | None = None
    """CPU seconds per second, over all threads."""
    period_ms: float | None = None
    """Length of a quota period."""
    memory_mb: float | None = None
    """Page cache included."""


class MeasuredSpeed(Record):
    """Speed of a host core measured by `slambed calibrate --host`."""

    speed: float
    """1 is a core of the reference host."""
    spread: float | None = None
    """(Maximum - minimum) of the measurements, relative; null when nothing was measured."""
    measured_utc: str | None = None
    """ISO 8601; null when nothing was measured."""


class NodeLimits(Record):
    """Configured and actual limits of one node of a live run."""

    asked: AskedLimits | None = None
    """Derived from its device; null: none."""
    granted: GrantedLimits | None = None
    """Reported by the kernel; null: none."""
    shortfall: str | None = None
    """Part of a board that this host cannot provide; null when it provides everything."""
    host_speed: MeasuredSpeed | None = None
    """With a board: the host speed used to derive the limits."""
    threads: list[ThreadCap] | None = None
    """With thread caps: each thread, in the order of their start."""


class Throttling(Record):
    """How much the kernel throttled a node, from its start to its end."""

    throttled_s: float
    """Time throttled by its own quota and by the caps of its threads."""
    throttled_periods: int
    """Throttled periods, counted like `throttled_s`."""
    periods: int
    """Elapsed periods of the node's quota."""


class SidecarUse(Record):
    """Resources that the sampler and the metronome used themselves."""

    samples: int
    """Number of samples taken."""
    sampler_cpu_percent: float | None = None
    """Percent of one core; null if sampling never began."""
    cpus: list[int]
    """CPUs that the sampler may use."""
    metronome_cpu_percent: float
    """Percent of one core; 0 without a metronome."""
    metronome_real_time: bool | None
    """Whether it got real-time priority; null without a metronome."""
    segmenter_cpu_s: float | None = None
    """CPU time of the segmenter, in the edge's cgroup where Docker allows it; null without one, and
    if it died before it could report."""
    segmenter_restarts: int | None = None
    """Number of restarts after the segmenter had died; null without a segmenter."""
    kernel_tick_ms: float | None = None
    """Tick period of the kernel's scheduler."""
