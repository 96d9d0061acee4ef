# SPDX-License-Identifier: Apache-2.0
"""Error of a live path against another system's run, in one map frame and without alignment.

CloudSLAM (SEC 2020, Sec. VII-A4) measures how far the poses it had at the time were from those that
ORB-SLAM had at the time, both starting in the map of the trip before. An alignment would take away
the very drift that this is about.
"""

from collections.abc import Mapping

import numpy as np

from slambed.errors import SlambedError
from slambed.metrics.accuracy import ErrorStatistics, statistics_of
from slambed.metrics.association import DEFAULT_MAX_DIFFERENCE_S, associate
from slambed.metrics.trajectory import Trajectory


def error_to_reference(
    live: Trajectory, reference: Trajectory, max_difference_s: float = DEFAULT_MAX_DIFFERENCE_S
) -> ErrorStatistics:
    """Euclidean distance of poses of the same frame, in metres.

    Raises SlambedError when no time stamps agree.
    """
    own, other = associate(live, reference, max_difference_s)
    if not len(own):
        raise SlambedError(
            "no pose of the reference run has the time of one of ours, "
            "compare runs of the same sequence and playback"
        )
    return statistics_of(np.linalg.norm(own.positions_m - other.positions_m, axis=1), "none")


def reference_of(paths: Mapping[str, Trajectory]) -> str:
    """Which of several runs of the reference system is the path to compare with (its run key).

    The one whose distance to all others together is smallest, so that a run gone astray is never
    chosen, and no ground truth is asked for. Equal ones: the first key. Runs that cannot be
    compared with any other come last. Raises SlambedError without a run.
    """
    if not paths:
        raise SlambedError("no run of the reference system, run it under the same conditions")
    keys = sorted(paths)
    if len(keys) == 1:
        return keys[0]
    return min(keys, key=lambda key: (_distance_to_others(key, paths), key))


def _distance_to_others(key: str, paths: Mapping[str, Trajectory]) -> float:
    distances = []
    for other, path in paths.items():
        if other != key:
            try:
                distances.append(error_to_reference(paths[key], path).rmse)
            except SlambedError:
                distances.append(float("inf"))
    return float(np.median(distances))
