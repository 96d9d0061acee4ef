# SPDX-License-Identifier: Apache-2.0
"""First guesses of how long a run takes, before any was measured."""

from slambed.campaign.plan import Plan
from slambed.spec.device import VIRTUAL
from slambed.spec.experiment import Playback

OVERHEAD_S = 3.0
"""Time for containers, link and start signal, besides the played time."""
VIRTUAL_SHARE = 0.1
"""Typical duration of a virtual run as a share of the played time."""
USUAL_S = 90.0
"""Assumed length of a sequence that is not there yet, in seconds."""


def expected_run_s(plan: Plan) -> float:
    """Returns a first estimate of a run's duration in seconds."""
    playback = plan.experiment.playback
    longest_s = max(sequence.played_s(playback) for sequence in plan.sequences.values())
    return _run_s(longest_s, plan.circumstances.engine == VIRTUAL)


def assumed_run_s(playback: Playback, virtual: bool) -> float:
    """Returns the same for sequences that are not there yet."""
    end_s = playback.end_s if playback.end_s is not None else USUAL_S
    return _run_s(max(0.0, end_s - playback.start_s), virtual)


def _run_s(played_s: float, virtual: bool) -> float:
    return played_s * VIRTUAL_SHARE if virtual else played_s + OVERHEAD_S
