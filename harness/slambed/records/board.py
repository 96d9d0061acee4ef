# SPDX-License-Identifier: Apache-2.0
"""Facts in the manifest about the board that executed a mobile node."""

from slambed.files.json_file import Record
from slambed.link.clocks import Clocks


class BoardFacts(Record):
    """The machine of the mobile node, if it was another machine."""

    name: str
    """Name in the experiment's file."""
    address: str
    """IPv4 address that ssh connected to."""
    edge_address: str
    """IPv4 address of this machine at which the board reached the edge."""
    architecture: str
    """Architecture as the kernel reports it."""
    model: str
    """Model of the board, or of its CPU where the board reports no model."""
    cores: int
    """Number of online CPUs."""
    kernel: str
    """Release of its kernel."""
    docker: str | None = None
    """Version of its Docker daemon."""
    image_id: str | None = None
    """Id of the node image on the board."""
    clocks: Clocks | None = None
    """Offset between its clock and this machine's."""
    sampler_cpu_percent: float | None = None
    """CPU use of the sampler, in percent of one core of the board."""
    tcp: dict[str, str] | None = None
    """TCP settings of its kernel, by name in /proc/sys."""
