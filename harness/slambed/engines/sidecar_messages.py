# SPDX-License-Identifier: Apache-2.0
"""What harness and sidecar of the nodes (`slambed.engines.sidecar`) say to each other."""

from typing import Annotated, Literal

from pydantic import Field, TypeAdapter

from slambed.process.line_protocol import Message, Start
from slambed.sampling.cgroup import Usage
from slambed.sampling.record import SidecarUse, ThreadCap


class MonitoredNode(Message):
    """A node as the sidecar has to know it."""

    pid: int
    """Of its first process, on the host."""
    thread_cores: float | None
    """Cap of each of its threads, in cores; null: none."""
    period_ms: float
    """Length of a quota period."""
    namespace: str | None
    """File of its network namespace, where its connections are watched."""


class OpenSidecar(Message):
    """The first request: which nodes to monitor. Caps threads and keeps the metronome from then
    on."""

    request: Literal["open"] = "open"
    nodes: dict[str, MonitoredNode]
    """By role."""
    samples: str
    """File that samples are written to."""
    cpus: list[int]
    """Where the process shall run; none: anywhere."""
    pace: str | None
    """The program of the metronome; null: none is needed."""
    metronome_cpus: list[int]
    """Those that it ticks on."""
    helper: bool
    """Whether this is a helper container, whose CPU group is not the host's."""
    whole_groups: bool
    """Whether a node may be several processes, all of its control group."""


class SidecarOpened(Message):
    """The answer: from now on threads are capped."""

    reply: Literal["opened"] = "opened"
    real_time_metronome: bool | None
    """Whether the metronome got real-time priority; null without one."""


class Follow(Message):
    """A node's program was started again."""

    request: Literal["follow"] = "follow"
    node: str
    """Its role."""
    pid: int
    """Of the new process."""


class Following(Message):
    """The answer."""

    reply: Literal["following"] = "following"


class Stop(Message):
    """One last sample; then the process ends."""

    request: Literal["stop"] = "stop"


class Stopped(Message):
    """The answer: what was seen."""

    reply: Literal["stopped"] = "stopped"
    usage: dict[str, Usage]
    """Last counters of each node."""
    threads: dict[str, list[ThreadCap]]
    """Of nodes with caps: what each thread was granted, in the order in which they began."""
    own: SidecarUse
    """What sampling and metronome took themselves."""


Request = Annotated[Start | Follow | Stop, Field(discriminator="request")]
FIRST: TypeAdapter[OpenSidecar] = TypeAdapter(OpenSidecar)
REQUESTS: TypeAdapter[Start | Follow | Stop] = TypeAdapter(Request)


class Ticking(Message):
    """What `slambed-pace tick` says when it has begun."""

    ready: Literal[True]
    """Always true."""
    real_time: bool
    """Whether it got real-time priority."""


TICKING: TypeAdapter[Ticking] = TypeAdapter(Ticking)
