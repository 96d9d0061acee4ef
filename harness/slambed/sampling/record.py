# SPDX-License-Identifier: Apache-2.0
"""What is said of a run's nodes beside their samples: in the manifest, and by the sampler."""

from dataclasses import dataclass

from slambed.files.json_file import Record


@dataclass(frozen=True)
class Sample:
    """A row of samples.jsonl and samples.parquet: one node at one moment."""

    t_s: float
    """Run time: CLOCK_MONOTONIC minus t0."""
    node: str
    """`mobile` or `edge`."""
    cpu_s: float
    """Cumulative."""
    cpu_percent: float | None
    """Of one core, since the last sample."""
    memory_mb: float
    """Resident; the page cache of the mapped sequence is not in it."""
    throttled_s: float
    """Cumulative; of the node's group and of the groups of its threads, so threads held back at
    once count each."""
    throttled_periods: int
    """As `throttled_s`."""
    run_delay_s: float | None
    """Cumulative: able to run and not running, all threads; on most kernels throttling is in it."""
    cpu_pressure_s: float | None
    """Cumulative PSI "some": of the node's group on cgroup v2, else of the host; null without
    PSI."""
    host_steal_s: float | None
    """Cumulative, over all processors of the host: time that its hypervisor gave to others."""
    tcp_rtt_ms: float | None
    """Mobile node: tcpi_rtt of the connection that was acknowledged last; null while there is
    none."""
    tcp_retransmits: int | None
    """Mobile node: TCP retransmissions of all connections; null while there is none."""


class ThreadCap(Record):
    """The cap of one thread of a node."""

    name: str
    """As the thread calls itself."""
    cores: float | None
    """Read back from the kernel; null: no cap."""
    period_ms: float
    """As `cores`."""
    throttled_s: float
    """Cumulative, at the end of the run."""
    throttled_periods: int
    """As `throttled_s`."""


class AskedLimits(Record):
    """Limits of a node as they follow from its device (catalog/devices/*.yaml); null: none."""

    cores: int | None = None
    """CPUs of the host that it may run on."""
    quota_cores: float | None = None
    """CPU seconds per second, over all threads."""
    thread_cores: float | None = None
    """The same of each single thread."""
    period_ms: float | None = None
    """Length of a quota period."""
    memory_mb: int | None = None
    """Page cache included."""
    cpus: list[int] | None = None
    """Numbers of those CPUs."""


class GrantedLimits(Record):
    """Limits as the kernel has them; null: none."""

    cpus: str | None = None
    """As the kernel writes lists: `0-2,5`."""
    quota_cores: float | None = None
    """CPU seconds per second, over all threads."""
    period_ms: float | None = None
    """Length of a quota period."""
    memory_mb: float | None = None
    """Page cache included."""


class MeasuredSpeed(Record):
    """Of a core of the host, as `slambed calibrate --host` measured it."""

    speed: float
    """1 is a core of the reference host."""
    spread: float | None = None
    """Largest minus smallest of the measurements, relative; null when nothing was measured."""
    measured_utc: str | None = None
    """ISO 8601; null when nothing was measured."""


class NodeLimits(Record):
    """What one node of a live run was to have, and had."""

    asked: AskedLimits | None = None
    """As they follow from its device; null: none."""
    granted: GrantedLimits | None = None
    """As the kernel has them; null: none."""
    shortfall: str | None = None
    """What of a board this host cannot give; null when it gives it all."""
    host_speed: MeasuredSpeed | None = None
    """With a board: what its limits were derived with."""
    threads: list[ThreadCap] | None = None
    """With caps: each thread's, in the order in which they began."""


class Throttling(Record):
    """How often the kernel held a node back, from its start to its end."""

    throttled_s: float
    """Held back by its own quota and by the caps of its threads."""
    throttled_periods: int
    """As `throttled_s`."""
    periods: int
    """Of the node's quota that went by."""


class SidecarUse(Record):
    """What sampler and metronome took themselves."""

    samples: int
    """How many were taken."""
    sampler_cpu_percent: float | None = None
    """Of one core; null where sampling never began."""
    cpus: list[int]
    """Those that the sampler may use."""
    metronome_cpu_percent: float
    """Of one core; 0 without a metronome."""
    metronome_real_time: bool | None
    """Whether it got real-time priority; null without one."""
    segmenter_cpu_s: float | None = None
    """CPU time of the segmenter, which is in the edge's group; null without one, and where one did
    not live to report it."""
    segmenter_restarts: int | None = None
    """How often a segmenter that had died was started again; null without one."""
    kernel_tick_ms: float | None = None
    """How often the kernel's scheduler looks by itself."""
