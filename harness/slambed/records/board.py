# SPDX-License-Identifier: Apache-2.0
"""What a manifest says about the board that executed a mobile node."""

from slambed.files.json_file import Record
from slambed.link.clocks import Clocks


class BoardFacts(Record):
    """The machine of the mobile node, where it was another one than this."""

    name: str
    """In the experiment's file."""
    address: str
    """IPv4, as ssh came to it."""
    edge_address: str
    """IPv4 of this machine, where it found the edge."""
    architecture: str
    """As its kernel names it."""
    model: str
    """Of the board, or of its CPU where it names no board."""
    cores: int
    """CPUs that are online."""
    kernel: str
    """Its release."""
    docker: str | None = None
    """Version of its daemon."""
    image_id: str | None = None
    """Of the node image there."""
    clocks: Clocks | None = None
    """Its clock against this machine's."""
    sampler_cpu_percent: float | None = None
    """Of one core of the board: what taking samples took."""
    tcp: dict[str, str] | None = None
    """TCP settings of its kernel, by their names in /proc/sys."""
