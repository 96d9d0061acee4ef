# SPDX-License-Identifier: Apache-2.0
"""What harness and agent on a board say to each other, as models on this side."""

from typing import Literal

from pydantic import BaseModel

from slambed.process.line_protocol import Message


class Look(Message):
    """What the machine is."""

    request: Literal["look"] = "look"


class Seen(Message):
    """The answer."""

    reply: Literal["seen"] = "seen"
    architecture: str
    """As its kernel names it."""
    model: str
    """Of the board, or of its CPU."""
    cpus: list[int]
    """Those that a node may use."""
    kernel: str
    """Its release."""
    python: str
    """Its version there."""
    from_address: str
    """Of this machine, as ssh came from it; empty: sshd does not report."""
    own_address: str
    """Of the board, as ssh came to it."""
    tcp: dict[str, str]
    """TCP settings of its kernel, by their names in /proc/sys."""


class Lock(Message):
    """Takes the lock by which live campaigns of that machine know each other."""

    request: Literal["lock"] = "lock"


class Locked(Message):
    """The answer."""

    reply: Literal["locked"] = "locked"
    ours: bool
    """False: a campaign has it."""


class Echo(Message):
    """Datagrams shall be answered with the time."""

    request: Literal["echo"] = "echo"
    address: str
    """Of the board: where to listen."""


class Echoing(Message):
    """The answer."""

    reply: Literal["echoing"] = "echoing"
    port: int
    """UDP."""


class AskClock(Message):
    """What time it is."""

    request: Literal["clock"] = "clock"


class ClockReading(Message):
    """The answer, by CLOCK_MONOTONIC."""

    reply: Literal["clock"] = "clock"
    received_ns: int
    """The question."""
    answered_ns: int
    """Just before the answer."""


class WatchNode(Message):
    """Which process is the mobile node."""

    request: Literal["watch"] = "watch"
    pid: int
    """On the board."""
    ports: list[int]
    """Of the edge: whose connections are watched."""


class GrantedThere(BaseModel):
    """Limits as the board's kernel has them."""

    cpus: str
    """As the kernel writes lists: `0-2,5`."""
    quota_cores: float | None
    """CPU seconds per second; null: no limit."""
    period_ms: float
    """Length of a quota period."""
    memory_mb: float | None
    """Page cache included; null: no limit."""


class Watching(Message):
    """The answer."""

    reply: Literal["watching"] = "watching"
    granted: GrantedThere
    """What the node has of the board."""


class StartSampling(Message):
    """Samples from now on."""

    request: Literal["start"] = "start"


class Sampling(Message):
    """The answer."""

    reply: Literal["sampling"] = "sampling"


class StopSampling(Message):
    """No more samples."""

    request: Literal["stop"] = "stop"


class BoardSample(BaseModel):
    """As `sampling.record.Sample`, by the clock of the board."""

    at_ns: int
    """CLOCK_MONOTONIC."""
    cpu_s: float
    """Cumulative."""
    memory_mb: float
    """Resident, without the mapped sequence."""
    throttled_s: float
    """Cumulative."""
    throttled_periods: int
    """As `throttled_s`."""
    periods: int
    """Of a quota, where the board's Docker sets one."""
    run_delay_s: float | None
    """Cumulative: able to run and not running."""
    cpu_pressure_s: float | None
    """Cumulative PSI "some"."""
    host_steal_s: float | None
    """Cumulative, over all processors of the board."""
    tcp_rtt_ms: float | None
    """Of the connection to the edge that was acknowledged last."""
    tcp_retransmits: int | None
    """Of all connections to the edge."""


class Sampled(Message):
    """The answer: what was seen."""

    reply: Literal["sampled"] = "sampled"
    samples: list[BoardSample]
    """In order of time."""
    sampler_cpu_percent: float
    """Of one core of the board."""
