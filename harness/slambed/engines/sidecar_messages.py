# SPDX-License-Identifier: Apache-2.0
"""Messages between the harness and the sidecar of the nodes (`slambed.engines.sidecar`)."""

from typing import Annotated, Literal

from pydantic import Field, TypeAdapter

from slambed.process.line_protocol import Message, Start
from slambed.sampling.cgroup import Usage
from slambed.sampling.record import SidecarUse, ThreadCap


class MonitoredNode(Message):
    """A node to be monitored by the sidecar."""

    pid: int
    """Id of its first process on the host."""
    thread_cores: float | None
    """CPU cap of each of its threads, in cores; null: none."""
    period_ms: float
    """Length of a quota period."""
    namespace: str | None
    """File of its network namespace, if its TCP connections are sampled."""


class OpenSidecar(Message):
    """First request: which nodes to monitor. Thread caps and metronome start immediately."""

    request: Literal["open"] = "open"
    nodes: dict[str, MonitoredNode]
    """By role."""
    samples: str
    """File for the samples."""
    cpus: list[int]
    """CPUs for the sidecar process; empty: any."""
    pace: str | None
    """Program of the metronome; null: none is needed."""
    metronome_cpus: list[int]
    """CPUs on which the metronome ticks."""
    helper: bool
    """Whether this is a helper container, whose CPU cgroup is not the host's."""
    whole_groups: bool
    """Whether a node may consist of all processes in its cgroup."""


class SidecarOpened(Message):
    """Answer: thread caps are active."""

    reply: Literal["opened"] = "opened"
    real_time_metronome: bool | None
    """Whether the metronome got real-time priority; null without one."""


class Follow(Message):
    """Reports that a node's program was restarted."""

    request: Literal["follow"] = "follow"
    node: str
    """Role of the node."""
    pid: int
    """Id of the new process."""


class Following(Message):
    """Answer."""

    reply: Literal["following"] = "following"


class Stop(Message):
    """Requests one last sample, then the end of the process."""

    request: Literal["stop"] = "stop"


class Stopped(Message):
    """Answer with the results."""

    reply: Literal["stopped"] = "stopped"
    usage: dict[str, Usage]
    """Final counters of each node."""
    threads: dict[str, list[ThreadCap]]
    """For nodes with caps: each thread's granted cap, in the order of their start."""
    own: SidecarUse
    """Resource use of the sampler and the metronome."""


Request = Annotated[Start | Follow | Stop, Field(discriminator="request")]
FIRST: TypeAdapter[OpenSidecar] = TypeAdapter(OpenSidecar)
REQUESTS: TypeAdapter[Start | Follow | Stop] = TypeAdapter(Request)


class Ticking(Message):
    """Message of `slambed-pace tick` when it has started."""

    ready: Literal[True]
    """Always true."""
    real_time: bool
    """Whether it got real-time priority."""


TICKING: TypeAdapter[Ticking] = TypeAdapter(Ticking)
