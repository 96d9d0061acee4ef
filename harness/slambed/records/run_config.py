# SPDX-License-Identifier: Apache-2.0
"""run.json: the configuration of a node. Nodes reject unknown keys."""

from typing import Literal

from slambed.files.json_file import Record
from slambed.spec.device import CostModel
from slambed.spec.experiment import Playback
from slambed.spec.system import Scalar


class ProfileRtt(Record):
    """RTT of the link's profile, for a node that does not measure it."""

    step_s: float
    """Time between two values; the first one is at run time 0."""
    rtt_ms: list[float]
    """Interpolated linearly; the last value holds until the end."""


class Network(Record):
    """Addresses over which the two nodes connect."""

    edge_address: str
    """IPv4 address."""
    ports: dict[str, int]
    """Channel -> TCP port of the edge."""
    profile_rtt: ProfileRtt | None = None
    """RTT of the link's profile; only with `params.rtt_source: profile`."""


class Segmenter(Record):
    """The segmenter that the edge sends its pictures to (docs/explanation/masks.md)."""

    socket: str
    """Path of the segmenter's socket on the edge."""
    time_limit_s: float
    """A picture whose masks take longer gets none."""


class PacedDevice(Record):
    """The device whose pace a node keeps (docs/explanation/limits.md, "At the device's pace")."""

    share: float
    """Share of a host CPU that equals one core of the device, and that each thread may use."""
    device: CostModel
    """Cost model of its stages, as in sim.json."""


class PacedDevices(Record):
    """The devices whose pace the nodes of a live run keep."""

    mobile: PacedDevice
    """Device of the mobile node."""
    edge: PacedDevice | None = None
    """Device of the edge; present exactly when there is a network."""


class RunConfig(Record):
    """The whole file; paths are as the node sees them."""

    format: Literal["slambed-run"]
    """Name of the format."""
    version: Literal[1]
    """Version of the format."""
    run_key: str
    """Key that identifies the run."""
    seed: int
    """Seed of all random numbers in the run."""
    system: str
    """Name of the system."""
    variant: str
    """Variant of the system."""
    params: dict[str, Scalar]
    """Checked against the system's own list. A parameter of type `path` names a file or is
    empty; the harness copies the file to `<output>/inputs/<parameter>`, and the run key holds
    its SHA-256."""
    sequence: str
    """Folder of the prepared sequence."""
    playback: Playback
    """How frames are offered to tracking."""
    network: Network | None
    """Null for a system that runs entirely on the mobile node, without an edge process."""
    segmenter: Segmenter | None = None
    """Only for the edge of a live run with segmentation."""
    pace: PacedDevices | None = None
    """Only for live runs with `pace: device`."""
    output: str
    """Folder that the nodes write to."""
    connect_timeout_s: float
    """Timeout for the connection to the peer."""

    def without(self, parameters: list[str]) -> "RunConfig":
        """Returns a copy for a node that does not receive these files."""
        return self.model_copy(update={"params": self.params | dict.fromkeys(parameters, "")})
