# SPDX-License-Identifier: Apache-2.0
"""Associates estimated poses with true poses by timestamp."""

from typing import Literal

from slambed.data.association import MAX_DIFFERENCE_S, match_nearest, match_tum
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError

Method = Literal["nearest", "tum"]


def associate(
    estimate: Trajectory,
    truth: Trajectory,
    max_difference_s: float = MAX_DIFFERENCE_S,
    method: Method = "nearest",
) -> tuple[Trajectory, Trajectory]:
    """Returns matched trajectories of equal length. `nearest`: each pose of the shorter
    trajectory is matched to the longer one, like evo does."""
    if method == "tum":
        i, j = match_tum(truth.stamps_s, estimate.stamps_s, max_difference_s)
        return estimate.take(j), truth.take(i)
    if method != "nearest":
        raise SlambedError(f"unknown association '{method}', choose nearest or tum")
    if len(truth) > len(estimate):
        i, j = match_nearest(estimate.stamps_s, truth.stamps_s, max_difference_s)
        return estimate.take(i), truth.take(j)
    i, j = match_nearest(truth.stamps_s, estimate.stamps_s, max_difference_s)
    return estimate.take(j), truth.take(i)
