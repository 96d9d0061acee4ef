# SPDX-License-Identifier: Apache-2.0
"""What every engine takes and gives: the run configuration, and how a run ended."""

import math
from dataclasses import dataclass, field
from typing import Literal

from slambed.link.facts import LinkFacts
from slambed.link.profile import parse_profile
from slambed.records.board import BoardFacts
from slambed.records.run_config import Network, ProfileRtt, RunConfig
from slambed.sampling.record import NodeLimits, SidecarUse, Throttling
from slambed.spec import inputs
from slambed.spec.run_spec import LinkSpec, RunSpec

Outcome = Literal["completed", "died", "timed_out", "refused"]
"""How the system under test fared, whatever its circumstances."""

NETWORK_EDGE_ADDRESS = "10.77.0.2"
FIRST_PORT = 47000
CONNECT_TIMEOUT_S = 20.0
START_AHEAD_S = 0.5
DRAIN_S = 30.0
"""A mobile node may drain its work after the last frame."""
OWN_PACE_FACTOR = 10.0
"""every_frame waits for tracking, and who reads a folder waits for nobody: a slow device may take
several times the recorded time."""
RTT_STEP_S = 0.1
"""DynNetSLAM's specification: profiles change every 100 ms."""


class InterruptedRunError(Exception):
    """The user asked to stop in the middle of a run."""


@dataclass
class RunResult:
    """How a run ended, and what was true while it ran."""

    outcome: Outcome
    reason: str | None
    """Why it did not complete."""
    invalid_reasons: list[str] = field(default_factory=list)
    """Why the circumstances were not as asked."""
    limits: dict[str, NodeLimits] = field(default_factory=dict)
    """By role, as `throttling`."""
    throttling: dict[str, Throttling] = field(default_factory=dict)
    link: LinkFacts | None = None
    sidecar: SidecarUse | None = None
    """What sampler and metronome took themselves."""
    board: BoardFacts | None = None
    """What executed the mobile node, where that was another machine."""
    mobile_until_s: float | None = None
    """Run time until which the mobile node ran, to a period of the watch; None: not known."""


def time_limit_s(spec: RunSpec, played_s: float, ahead_s: float = START_AHEAD_S) -> float:
    """How long a live run may take that plays for `played_s` at recorded speed, and whose nodes are
    reported so long before it begins."""
    reads = spec.runtime is not None and spec.runtime.reads is not None
    factor = OWN_PACE_FACTOR if reads or spec.playback.mode == "every_frame" else 1.0
    return ahead_s + played_s * factor + DRAIN_S


def profile_rtt(link: LinkSpec, horizon_s: float) -> ProfileRtt:
    """The RTT that the profile asks for, for a node that shall not measure it."""
    profile = parse_profile(link.content, f"profile {link.profile}")
    end_s = horizon_s if profile.duration is None else min(profile.duration, horizon_s)
    steps = range(math.ceil(end_s / RTT_STEP_S) + 1)
    rtt_ms = [round(profile.rtt_ms(step * RTT_STEP_S), 4) for step in steps]
    return ProfileRtt(step_s=RTT_STEP_S, rtt_ms=rtt_ms)


def run_config(
    spec: RunSpec,
    sequence: str,
    output: str,
    horizon_s: float,
    edge_address: str = NETWORK_EDGE_ADDRESS,
) -> RunConfig:
    """run.json (docs/reference/run-folder.md); both paths as the nodes see them. The run is over
    before the horizon."""
    network: Network | None = None
    if spec.link is not None:
        ports = {name: FIRST_PORT + index for index, name in enumerate(spec.channels)}
        network = Network(edge_address=edge_address, ports=ports)
        if spec.params.get("rtt_source") == "profile":
            asked = profile_rtt(spec.link, horizon_s)
            network = network.model_copy(update={"profile_rtt": asked})
    return RunConfig(
        format="slambed-run",
        version=1,
        run_key=spec.run_key,
        seed=spec.seed,
        system=spec.system,
        variant=spec.variant,
        params=spec.params | {name: inputs.inside(output, name) for name in spec.inputs},
        sequence=sequence,
        playback=spec.playback,
        network=network,
        output=output,
        connect_timeout_s=CONNECT_TIMEOUT_S,
    )
