# SPDX-License-Identifier: Apache-2.0
"""Makes the tables of docs/ from records: files of a run, and messages between processes."""

from slambed.campaign.host_messages import AskPorts, FreePorts, JoinCampaign, Joined
from slambed.engines.board.messages import (
    AskClock,
    ClockReading,
    Echo,
    Echoing,
    Lock,
    Locked,
    Look,
    Sampled,
    Sampling,
    Seen,
    StartSampling,
    StopSampling,
    Watching,
    WatchNode,
)
from slambed.engines.sidecar_messages import (
    Follow,
    Following,
    OpenSidecar,
    SidecarOpened,
    Stop,
    Stopped,
    Ticking,
)
from slambed.link.direction import DirectionConfig, RelayConfig
from slambed.link.facts import LinkFacts
from slambed.link.helper_messages import (
    Alive,
    AskAlive,
    LinkStopped,
    Opened,
    OpenLink,
    StopLink,
)
from slambed.link.relay import RelayApplied, RelayReady, RelayStarted
from slambed.process.line_protocol import Failure, Start, Started
from slambed.records.kept_spec import KeptSpec
from slambed.records.manifest import Manifest
from slambed.records.run_config import RunConfig
from slambed.records.sim_config import SimConfig
from slambed.sampling.cgroup import Usage
from slambed.sampling.record import Sample, SidecarUse
from slambed.schema.field_table import field_rows, in_a_row
from slambed.spec.device import CostModel
from slambed.spec.run_spec import RunSpec

Rows = list[list[str]]
HEADINGS = ["key", "type", "unit", "meaning"]
RECORDS: dict[str, tuple[type, tuple[type, ...]]] = {
    "run": (RunConfig, (CostModel,)),
    "sim": (SimConfig, (CostModel,)),
    "relay": (RelayConfig, (DirectionConfig,)),
    "samples": (Sample, ()),
    "manifest": (Manifest, (RunSpec, KeptSpec)),
}
"""Maps a table to its record, and to nested records that it does not expand."""
LINES = (
    (
        "harness and the sidecar of the nodes",
        (OpenSidecar, SidecarOpened, Start, Started, Follow, Following, Stop, Stopped),
    ),
    (
        "harness and the keeper of a link",
        (OpenLink, Opened, Start, Started, AskAlive, Alive, StopLink, LinkStopped),
    ),
    (
        "campaign and its worker on a host of `--hosts`",
        (AskPorts, FreePorts, JoinCampaign, Joined),
    ),
    (
        "harness and the agent on a board",
        (
            *(Look, Seen, Lock, Locked, Echo, Echoing, AskClock, ClockReading, WatchNode, Watching),
            *(StartSampling, Sampling, StopSampling, Sampled),
        ),
    ),
    ("any of them, instead of an answer", (Failure,)),
    ("`slambed-relay` to whoever started it", (RelayReady, RelayApplied, RelayStarted)),
    ("`slambed-pace tick` to whoever started it", (Ticking,)),
)
"""The two ends, and their messages in order."""


def record_table(name: str) -> tuple[list[str], Rows]:
    if name == "lines":
        return ["who", "`request` or `reply`", "fields", "meaning"], _messages()
    record, whole = RECORDS[name]
    return HEADINGS, list(field_rows(record, whole))


def _messages() -> Rows:
    unfolded = (RunSpec, Usage, *(record for record, _ in RECORDS.values()), LinkFacts, SidecarUse)
    rows = []
    for who, messages in LINES:
        for message in messages:
            tag = message.model_fields.get("request") or message.model_fields.get("reply")
            tag_name = "" if tag is None else f"`{tag.default}`"
            rows.append([who, tag_name, "", in_a_row(message.__doc__ or "")])
            rows += [
                ["", "", f"{key} ({kind})", meaning]
                for key, kind, _, meaning in field_rows(
                    message, unfolded, skipped=("request", "reply")
                )
            ]
            who = ""
    return rows
