# SPDX-License-Identifier: Apache-2.0
"""Messages between the harness and the agent on a board, as models of the harness side."""

from typing import Literal

from pydantic import BaseModel

from slambed.process.line_protocol import Message


class Look(Message):
    """Asks for facts about the machine."""

    request: Literal["look"] = "look"


class Seen(Message):
    """Answer."""

    reply: Literal["seen"] = "seen"
    architecture: str
    """Architecture as the kernel reports it."""
    model: str
    """Model of the board, or of its CPU."""
    cpus: list[int]
    """CPUs that a node may use."""
    kernel: str
    """Release of its kernel."""
    python: str
    """Version of its Python."""
    from_address: str
    """Address of this machine in the ssh connection; empty if sshd does not report it."""
    own_address: str
    """Address of the board in the ssh connection."""
    tcp: dict[str, str]
    """TCP settings of its kernel, by name in /proc/sys."""


class Lock(Message):
    """Requests the lock of live campaigns on that machine."""

    request: Literal["lock"] = "lock"


class Locked(Message):
    """Answer."""

    reply: Literal["locked"] = "locked"
    ours: bool
    """False if another campaign holds it."""


class Echo(Message):
    """Requests a UDP service that answers datagrams with the time."""

    request: Literal["echo"] = "echo"
    address: str
    """Address of the board to listen on."""


class Echoing(Message):
    """Answer."""

    reply: Literal["echoing"] = "echoing"
    port: int
    """UDP port."""


class AskClock(Message):
    """Asks for the time."""

    request: Literal["clock"] = "clock"


class ClockReading(Message):
    """Answer, in CLOCK_MONOTONIC."""

    reply: Literal["clock"] = "clock"
    received_ns: int
    """Time at which the request was received."""
    answered_ns: int
    """Time immediately before the answer."""


class WatchNode(Message):
    """Reports the process of the mobile node."""

    request: Literal["watch"] = "watch"
    pid: int
    """Process id on the board."""
    ports: list[int]
    """Ports of the edge, whose TCP connections are sampled."""


class GrantedThere(BaseModel):
    """Limits as the board's kernel reports them."""

    cpus: str
    """List in the kernel's format: `0-2,5`."""
    quota_cores: float | None
    """CPU seconds per second; null: no limit."""
    period_ms: float
    """Length of a quota period."""
    memory_mb: float | None
    """Page cache included; null: no limit."""


class Watching(Message):
    """Answer."""

    reply: Literal["watching"] = "watching"
    granted: GrantedThere
    """The node's limits on the board."""


class StartSampling(Message):
    """Requests to start sampling."""

    request: Literal["start"] = "start"


class Sampling(Message):
    """Answer."""

    reply: Literal["sampling"] = "sampling"


class StopSampling(Message):
    """Requests to stop sampling."""

    request: Literal["stop"] = "stop"


class BoardSample(BaseModel):
    """Like `sampling.record.Sample`, with times of the board's clock."""

    at_ns: int
    """CLOCK_MONOTONIC."""
    cpu_s: float
    """Cumulative."""
    memory_mb: float
    """Resident memory, without the mapped sequence."""
    throttled_s: float
    """Cumulative."""
    throttled_periods: int
    """Throttled periods, counted like `throttled_s`."""
    periods: int
    """Periods of a quota, if the board's Docker sets one."""
    run_delay_s: float | None
    """Cumulative time in which threads were runnable but not running."""
    cpu_pressure_s: float | None
    """Cumulative PSI "some"."""
    host_steal_s: float | None
    """Cumulative, over all CPUs of the board."""
    tcp_rtt_ms: float | None
    """RTT of the connection to the edge with the most recent ACK."""
    tcp_retransmits: int | None
    """Retransmissions of all connections to the edge."""


class Sampled(Message):
    """Answer with the samples."""

    reply: Literal["sampled"] = "sampled"
    samples: list[BoardSample]
    """In order of time."""
    sampler_cpu_percent: float
    """Percent of one core of the board."""
