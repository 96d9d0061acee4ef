# SPDX-License-Identifier: Apache-2.0
"""Common to all engines: the run configuration, and how a run ended."""

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
"""How the system under test performed, independent of the validity of the run."""

NETWORK_EDGE_ADDRESS = "10.77.0.2"
FIRST_PORT = 47000
CONNECT_TIMEOUT_S = 20.0
START_AHEAD_S = 0.5
DRAIN_S = 30.0
"""Time for a mobile node to finish its work after the last frame."""
OWN_PACE_FACTOR = 10.0
"""With every_frame, or for a system that reads a folder, a slow device may take several times
the recorded time."""
RTT_STEP_S = 0.1
"""DynNetSLAM's specification: profiles change every 100 ms."""


class InterruptedRunError(Exception):
    """The user stopped the campaign during a run."""


@dataclass
class RunResult:
    """The outcome of a run and the circumstances during it."""

    outcome: Outcome
    reason: str | None
    """Why it did not complete."""
    invalid_reasons: list[str] = field(default_factory=list)
    """Why the circumstances were not as configured."""
    limits: dict[str, NodeLimits] = field(default_factory=dict)
    """By role, like `throttling`."""
    throttling: dict[str, Throttling] = field(default_factory=dict)
    link: LinkFacts | None = None
    sidecar: SidecarUse | None = None
    """Resource use of the sampler and the metronome."""
    board: BoardFacts | None = None
    """The machine that executed the mobile node, if it was another one."""
    mobile_until_s: float | None = None
    """Run time until which the mobile node ran, with the resolution of the watch period; None:
    unknown."""


def time_limit_s(spec: RunSpec, played_s: float, ahead_s: float = START_AHEAD_S) -> float:
    """Returns the time limit of a live run that plays `played_s` at recorded speed and whose
    start time is sent `ahead_s` in advance."""
    reads = spec.runtime is not None and spec.runtime.reads is not None
    factor = OWN_PACE_FACTOR if reads or spec.playback.mode == "every_frame" else 1.0
    return ahead_s + played_s * factor + DRAIN_S


def profile_rtt(link: LinkSpec, horizon_s: float) -> ProfileRtt:
    """Returns the RTT of the profile, for a node that does not measure it."""
    profile = parse_profile(link.content, f"profile {link.profile}")
    settled_s = profile.settled_s
    end_s = horizon_s if settled_s is None else min(settled_s, horizon_s)
    steps = range(math.ceil(end_s / RTT_STEP_S) + 1)
    rtt_ms = [round(profile.rtt_ms(step * RTT_STEP_S), 4) for step in steps]
    if end_s == settled_s:
        # As in delay_table_ms.
        after = round(profile.rtt_ms(len(steps) * RTT_STEP_S), 4)
        if after != rtt_ms[-1]:
            rtt_ms.append(after)
    return ProfileRtt(step_s=RTT_STEP_S, rtt_ms=rtt_ms)


def run_config(
    spec: RunSpec,
    sequence: str,
    output: str,
    horizon_s: float,
    edge_address: str = NETWORK_EDGE_ADDRESS,
) -> RunConfig:
    """Returns the run configuration (docs/reference/run-folder.md); both paths are as the nodes see
    them. The run must end before the horizon."""
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
