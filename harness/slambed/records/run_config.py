# SPDX-License-Identifier: Apache-2.0
"""run.json: what a node is to do. Nodes refuse keys that they do not know."""

from typing import Literal

from slambed.files.json_file import Record
from slambed.spec.device import CostModel
from slambed.spec.experiment import Playback
from slambed.spec.system import Scalar


class ProfileRtt(Record):
    """The RTT that the link's profile asks for, for a node that shall not measure it."""

    step_s: float
    """Run time between two values; the first one is at 0."""
    rtt_ms: list[float]
    """Linear between the values, the last one for ever."""


class Network(Record):
    """Where the two nodes find each other."""

    edge_address: str
    """IPv4."""
    ports: dict[str, int]
    """Channel -> TCP port of the edge."""
    profile_rtt: ProfileRtt | None = None
    """Only with `params.rtt_source: profile`: what the link's profile asks for."""


class Segmenter(Record):
    """Where the edge has its pictures segmented (docs/explanation/masks.md)."""

    socket: str
    """Of the segmenter beside the edge."""
    time_limit_s: float
    """A picture whose masks take longer has none."""


class PacedDevice(Record):
    """Whose pace a node keeps (docs/explanation/limits.md, "At the device's pace")."""

    share: float
    """Of a CPU of the host that one of its cores is: what each thread may use."""
    device: CostModel
    """As in sim.json: what its stages take."""


class PacedDevices(Record):
    """The devices whose pace the nodes of a live run keep."""

    mobile: PacedDevice
    """The mobile node's."""
    edge: PacedDevice | None = None
    """Exactly where there is a network."""


class RunConfig(Record):
    """The whole file; paths are as the node sees them."""

    format: Literal["slambed-run"]
    """Of the file."""
    version: Literal[1]
    """Of the format."""
    run_key: str
    """What names the run."""
    seed: int
    """Of everything drawn in the run."""
    system: str
    """Its name."""
    variant: str
    """Of the system."""
    params: dict[str, Scalar]
    """Checked against the system's own list. One of type `path` names a file, or is empty: the
    harness copies the file to `<output>/inputs/<parameter>`, and the run key holds its SHA-256."""
    sequence: str
    """Folder of the prepared sequence."""
    playback: Playback
    """How frames are offered to tracking."""
    network: Network | None
    """Null where everything is on the mobile node: then there is no edge process."""
    segmenter: Segmenter | None = None
    """Only for the edge of a live run that segments."""
    pace: PacedDevices | None = None
    """Only of live runs with `pace: device`."""
    output: str
    """Folder that the nodes write to."""
    connect_timeout_s: float
    """How long a node waits for its peer."""

    def without(self, parameters: list[str]) -> "RunConfig":
        """The same for a node that is given none of these files."""
        return self.model_copy(update={"params": self.params | dict.fromkeys(parameters, "")})
