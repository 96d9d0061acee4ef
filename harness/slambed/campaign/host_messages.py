# SPDX-License-Identifier: Apache-2.0
"""What a campaign and its worker on a host (`host_worker`) say to each other before the worker is
one of the scheduler's."""

from typing import Annotated, Literal

from pydantic import Field

from slambed.process.line_protocol import Message


class AskPorts(Message):
    """The first connection: what lies there, and which ports the second one may forward."""

    request: Literal["ports"] = "ports"


class FreePorts(Message):
    """The answer."""

    reply: Literal["ports"] = "ports"
    scheduler: int
    """Of the host's loopback: there the worker will find the scheduler."""
    worker: int
    """There it will listen."""
    harness: str
    """Digest of the Python that lies there."""


class JoinCampaign(Message):
    """The second connection: be a worker of this campaign until the input ends."""

    request: Literal["join"] = "join"
    name: str
    """Of the host."""
    labels: list[str]
    """Of the host."""
    engine: Literal["docker", "local"]
    """That runs get there."""
    cores: int | None
    """CPUs that runs may use, the first ones; null: all."""
    scheduler: str
    """Address of the scheduler as the host sees it."""
    port: int
    """Of the host's loopback, to listen at; 0: any."""
    contact: str | None
    """Address of the worker as the scheduler sees it; null: where it listens."""
    certificate: str
    """PEM, made for this campaign: who does not show it is not talked to."""
    key: str
    """PEM, of the certificate."""
    wait_s: float
    """How long to wait for another campaign on the host to end."""
    quiet_s: float
    """How long to wait for it to become quiet."""
    measure: bool
    """Whether limits will follow from the speed of the host."""
    take: bool
    """Whether it shall execute runs: then it has the host's lock. False: it only answers, and the
    host is left as it is."""


class Joined(Message):
    """The answer, when the host is the campaign's."""

    reply: Literal["joined"] = "joined"
    worker: str
    """Address that the scheduler knows the worker by."""
    software: str
    """Tag of what runs are made of there."""
    netem: bool
    """Whether its kernel has netem."""
    cpu_model: str
    """As its kernel names it."""
    cpus: list[int]
    """That runs may use."""
    speed: float
    """Of one core; 1 is a core of the reference host."""
    speed_measured_utc: str | None
    """ISO 8601; null: never, it is taken for 1."""
    load: str
    """How quiet it is, in words."""
    tidied: str
    """What a killed campaign had left there, in words."""


Request = Annotated[AskPorts | JoinCampaign, Field(discriminator="request")]
"""All that a worker understands."""
