# SPDX-License-Identifier: Apache-2.0
"""Messages between the harness and the process that holds a link (`slambed.link.link_helper`)."""

from typing import Annotated, Literal

from pydantic import Field

from slambed.link.facts import LinkFacts
from slambed.process.line_protocol import Message, Start
from slambed.spec.run_spec import RunSpec


class OpenLink(Message):
    """First request: connect two namespaces with the link of a run."""

    request: Literal["open"] = "open"
    spec: RunSpec
    """Complete specification of the run."""
    mobile: str
    """File of the mobile node's network namespace."""
    edge: str
    """File of the edge's network namespace."""
    log_dir: str
    """Folder for the link's own files."""
    longest_s: float
    """Maximum duration of the run."""


class Opened(Message):
    """Answer: the profile's value at time 0 is in force."""

    reply: Literal["opened"] = "opened"


class AskAlive(Message):
    """Asks whether the link still works."""

    request: Literal["alive"] = "alive"


class Alive(Message):
    """Answer."""

    reply: Literal["alive"] = "alive"
    alive: bool
    """False once the link has failed."""


class StopLink(Message):
    """Requests to take the link down and exit."""

    request: Literal["stop"] = "stop"


class LinkStopped(Message):
    """Answer."""

    reply: Literal["stopped"] = "stopped"
    link: LinkFacts
    """Facts for the manifest."""


Request = Annotated[OpenLink | Start | AskAlive | StopLink, Field(discriminator="request")]
