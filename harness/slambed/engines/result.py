# SPDX-License-Identifier: Apache-2.0
"""What every engine takes and gives: the run configuration, and how a run ended."""

from dataclasses import dataclass, field
from typing import Any, Literal

from slambed.spec import inputs
from slambed.spec.matrix import RunSpec

Outcome = Literal["completed", "edge_died", "mobile_died", "timeout", "link_died"]

NETWORK_EDGE_ADDRESS = "10.77.0.2"
FIRST_PORT = 47000
CONNECT_TIMEOUT_S = 20.0


class InterruptedRunError(Exception):
    """The user asked to stop in the middle of a run."""


@dataclass
class RunResult:
    """How a run ended, and what was true while it ran."""

    outcome: Outcome
    reason: str | None
    limits: dict[str, Any] = field(default_factory=dict)
    throttling: dict[str, Any] = field(default_factory=dict)
    link: dict[str, Any] | None = None
    beside: dict[str, Any] | None = None
    """What sampler and metronome took themselves."""


def run_json(spec: RunSpec, sequence: str, output: str) -> dict[str, Any]:
    """The run configuration (docs/formats.md); both paths as the nodes see them."""
    network: dict[str, Any] | None = None
    if spec.link is not None:
        ports = {name: FIRST_PORT + index for index, name in enumerate(spec.channels)}
        network = {"edge_address": NETWORK_EDGE_ADDRESS, "ports": ports}
    return {
        "format": "slambed-run",
        "version": 1,
        "run_key": spec.run_key,
        "seed": spec.seed,
        "system": spec.system,
        "variant": spec.variant,
        "params": spec.params | {name: inputs.inside(output, name) for name in spec.inputs},
        "sequence": sequence,
        "playback": spec.playback.model_dump(mode="json"),
        "network": network,
        "output": output,
        "connect_timeout_s": CONNECT_TIMEOUT_S,
    }
