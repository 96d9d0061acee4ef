# SPDX-License-Identifier: Apache-2.0
"""What is said of a run's nodes beside their samples: in the manifest, and by the sampler."""

from slambed.json_file import Record


class ThreadCap(Record):
    """The cap of one thread of a node."""

    name: str
    cores: float | None
    """Read back from the kernel; null: no cap."""
    period_ms: float
    throttled_s: float
    """Cumulative, at the end of the run."""
    throttled_periods: int


class AskedLimits(Record):
    """Limits of a node as they follow from its device (devices/*.yaml); null: none."""

    cores: int | None = None
    """CPUs of the host that it may run on."""
    quota_cores: float | None = None
    """CPU seconds per second, over all threads."""
    thread_cores: float | None = None
    """The same of each single thread."""
    period_ms: float | None = None
    """Length of a quota period."""
    memory_mb: int | None = None
    cpus: list[int] | None = None
    """Numbers of those CPUs."""


class GrantedLimits(Record):
    """Limits as the kernel has them; null: none."""

    cpus: str | None = None
    """As the kernel writes lists: `0-2,5`."""
    quota_cores: float | None = None
    period_ms: float | None = None
    memory_mb: float | None = None


class MeasuredSpeed(Record):
    """Of a core of the host, as `slambed calibrate --host` measured it."""

    speed: float
    """1 is a core of the reference host."""
    spread: float | None = None
    """Largest minus smallest of the measurements, relative; null when nothing was measured."""
    measured_utc: str | None = None


class NodeLimits(Record):
    """What one node of a live run was to have, and had."""

    asked: AskedLimits | None = None
    granted: GrantedLimits | None = None
    shortfall: str | None = None
    """What of a board this host cannot give; null when it gives it all."""
    host_speed: MeasuredSpeed | None = None
    """With a board: what its limits were derived with."""
    threads: list[ThreadCap] | None = None
    """With caps: each thread's, in the order in which they began."""


class Throttling(Record):
    """How often the kernel held a node back, from its start to its end."""

    throttled_s: float
    throttled_periods: int
    periods: int
    """Of the node's quota that went by."""


class Beside(Record):
    """What sampler and metronome took themselves."""

    samples: int
    sampler_cpu_percent: float | None = None
    """Of one core; null where sampling never began."""
    cpus: list[int]
    """Those that the sampler may use."""
    metronome_cpu_percent: float
    metronome_real_time: bool | None
    """Whether it got real-time priority; null without one."""
    kernel_tick_ms: float | None = None
    """How often the kernel's scheduler looks by itself."""
