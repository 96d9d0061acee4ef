# SPDX-License-Identifier: Apache-2.0
"""`slambed calibrate --host`: measures how fast a core of this host does the fixed work of
slambed-pace."""

import json
import statistics
import subprocess
from dataclasses import dataclass
from typing import Any

from slambed.campaign.ledger import utc_now
from slambed.errors import SlambedError, environment_error
from slambed.native import find_program, how_to_build
from slambed.spec.host_speed import HostSpeed

PROGRAM = "slambed-pace"
WORKLOAD = 1
"""Version of the work; speeds of different versions cannot be compared."""
REFERENCE_UNITS_PER_S = 9000.0
"""Units of work per second of CPU time on a core of the reference host: an AMD EPYC of the Zen 5
family in a virtual machine (docs/how-to/calibrate-a-host.md)."""
ROUNDS = 7
ROUND_S = 1.0


@dataclass(frozen=True)
class HostMeasurement:
    """The measured rounds, in units per second of CPU time."""

    units_per_s: list[float]

    @property
    def speed(self) -> HostSpeed:
        """Returns the speed of the median round, which disturbances affect least."""
        middle = statistics.median(self.units_per_s)
        spread = (max(self.units_per_s) - min(self.units_per_s)) / middle
        return HostSpeed(round(middle / REFERENCE_UNITS_PER_S, 4), round(spread, 4), utc_now())


def measure_host(rounds: int = ROUNDS, seconds: float = ROUND_S) -> HostMeasurement:
    """Measures one thread `rounds` times. CPU time is used, so that other load does not count."""
    return HostMeasurement(
        [float(run_pace(seconds)["threads"][0]["units_per_cpu_s"]) for _ in range(rounds)]
    )


def run_pace(seconds: float) -> dict[str, Any]:
    """Returns the output of `slambed-pace` with one thread; it inherits our CPUs and has no
    limits."""
    command = [str(find_program(PROGRAM)), "--threads", "1", "--seconds", str(seconds)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise environment_error(f"{PROGRAM} failed: {done.stderr.strip() or done.returncode}")
    content: dict[str, Any] = json.loads(done.stdout)
    if content["workload"] != WORKLOAD:
        text = f"{PROGRAM} does other work than this harness knows; run {how_to_build()}"
        raise SlambedError(text)
    return content
