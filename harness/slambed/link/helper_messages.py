# SPDX-License-Identifier: Apache-2.0
"""What the harness and the process that keeps a link (`slambed.link.link_helper`) say to each
other."""

from typing import Annotated, Literal

from pydantic import Field

from slambed.link.facts import LinkFacts
from slambed.process.line_protocol import Message, Start
from slambed.spec.run_spec import RunSpec


class OpenLink(Message):
    """The first request: join two namespaces by the link that a run asks for."""

    request: Literal["open"] = "open"
    spec: RunSpec
    """The whole run."""
    mobile: str
    """File of the mobile node's network namespace."""
    edge: str
    """The same of the edge."""
    log_dir: str
    """Folder for the link's own files."""
    longest_s: float
    """How long the run may last."""


class Opened(Message):
    """The answer: the profile's value at time 0 is in force."""

    reply: Literal["opened"] = "opened"


class AskAlive(Message):
    """Whether the link is still there."""

    request: Literal["alive"] = "alive"


class Alive(Message):
    """The answer."""

    reply: Literal["alive"] = "alive"
    alive: bool
    """False once it went away by itself."""


class StopLink(Message):
    """Take the link down; then the process ends."""

    request: Literal["stop"] = "stop"


class LinkStopped(Message):
    """The answer."""

    reply: Literal["stopped"] = "stopped"
    link: LinkFacts
    """For the manifest."""


Request = Annotated[OpenLink | Start | AskAlive | StopLink, Field(discriminator="request")]
