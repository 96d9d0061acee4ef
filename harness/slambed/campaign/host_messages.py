# SPDX-License-Identifier: Apache-2.0
"""Messages between a campaign and its worker on a host (`host_worker`), before the worker joins
the scheduler."""

from typing import Annotated, Literal

from pydantic import Field

from slambed.process.line_protocol import Message


class AskPorts(Message):
    """Request on the first connection: report the version and free ports to forward."""

    request: Literal["ports"] = "ports"


class FreePorts(Message):
    """Answer."""

    reply: Literal["ports"] = "ports"
    scheduler: int
    """Loopback port of the host at which the worker will reach the scheduler."""
    worker: int
    """Loopback port of the host that the worker will listen on."""
    harness: str
    """Digest of the harness's Python files on the host."""


class JoinCampaign(Message):
    """Request on the second connection: be a worker of this campaign until the input ends."""

    request: Literal["join"] = "join"
    name: str
    """Name of the host."""
    labels: list[str]
    """Labels of the host."""
    engine: Literal["docker", "local"]
    """Engine of its runs."""
    cores: int | None
    """Number of CPUs for runs, from the first one on; null: all."""
    scheduler: str
    """Address of the scheduler as seen from the host."""
    port: int
    """Loopback port of the host to listen on; 0: any."""
    contact: str | None
    """Address of the worker as seen from the scheduler; null: its listening address."""
    certificate: str
    """PEM certificate of this campaign; peers without it are rejected."""
    key: str
    """PEM key of the certificate."""
    wait_s: float
    """How long to wait for the end of another campaign on the host."""
    quiet_s: float
    """How long to wait for the host to become quiet."""
    measure: bool
    """Whether limits will be derived from the speed of the host."""
    take: bool
    """Whether it will execute runs and therefore takes the host's lock. If false, it only
    reports facts and changes nothing on the host."""


class Joined(Message):
    """Answer when the host has joined the campaign."""

    reply: Literal["joined"] = "joined"
    worker: str
    """Address of the worker, as known to the scheduler."""
    software: str
    """Software tag of runs on the host."""
    netem: bool
    """Whether its kernel has netem."""
    cpu_model: str
    """CPU model as the kernel reports it."""
    cpus: list[int]
    """CPUs that runs may use."""
    speed: float
    """Speed of one core; 1 is a core of the reference host."""
    speed_measured_utc: str | None
    """ISO 8601; null: not measured, 1 was assumed."""
    load: str
    """Load of the host, as text."""
    tidied: str
    """Leftovers of a killed campaign that were removed, as text."""


Request = Annotated[AskPorts | JoinCampaign, Field(discriminator="request")]
"""All requests that a worker understands."""
