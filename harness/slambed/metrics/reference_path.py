# SPDX-License-Identifier: Apache-2.0
"""Error of a live path relative to another system's run, in the same map frame and without
alignment.

CloudSLAM (SEC 2020, Sec. VII-A4) compares its live poses with those of ORB-SLAM, both starting in
the map of the previous trip. An alignment would remove the drift that this metric measures.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from slambed.data.association import MAX_DIFFERENCE_S
from slambed.data.trajectory import EMPTY, Trajectory
from slambed.errors import SlambedError
from slambed.metrics.accuracy import ErrorStatistics, absolute_error, statistics_of
from slambed.metrics.association import associate
from slambed.metrics.events import EventLog


def error_to_reference(
    live: Trajectory, reference: Trajectory, max_difference_s: float = MAX_DIFFERENCE_S
) -> ErrorStatistics:
    """Returns statistics of the Euclidean distance of poses of the same frame, in meters.

    Raises SlambedError if no timestamps match.
    """
    own, other = associate(live, reference, max_difference_s)
    if not len(own):
        raise SlambedError(
            "no pose of the reference run has the time of one of ours, "
            "compare runs of the same sequence and playback"
        )
    return statistics_of(np.linalg.norm(own.positions_m - other.positions_m, axis=1), "none")


@dataclass(frozen=True)
class ReferenceErrors:
    """RMSE of live poses relative to a reference path, in meters, and the number of frames."""

    rmse_m: float | None = None
    aligned_m: float | None = None
    pairs: int | None = None


def reference_errors(live: Trajectory, reference: Trajectory) -> ReferenceErrors:
    """Returns the error without and with one rigid alignment; empty for a run without a scored
    pose."""
    if not len(live):
        return ReferenceErrors()
    plain = error_to_reference(live, reference)
    try:
        aligned: float | None = absolute_error(live, reference).rmse
    except SlambedError:
        aligned = None  # too few poses to align
    return ReferenceErrors(plain.rmse, aligned, plain.pairs)


def scored_part(live: Trajectory, log: EventLog) -> Trajectory:
    """Returns the poses that are in the frame of the reference. For a system that aligns itself
    during the run (state ALIGN, `trip_aligned`, `align_failed`) these are the poses between each
    `trip_aligned` and the next reset; otherwise all."""
    changes = log.of("state_changed")
    aligning = any("ALIGN" in (event.get("from"), event.get("to")) for event in changes) or bool(
        log.of("trip_aligned", "align_failed")
    )
    first = next((e for e in log.of("frame_tracked") if e.get("state") == "ok"), None)
    if not aligning or first is None or not len(live):
        return live if not aligning else EMPTY
    times_s = live.stamps_s - live.stamps_s[0] + float(first["seq_s"])
    scored = np.zeros(len(live), dtype=bool)
    for event in log.of("trip_aligned", "reset"):
        scored[times_s >= float(event["seq_s"]) - 1e-6] = event["type"] == "trip_aligned"
    return live.take(np.flatnonzero(scored))


def reference_of(paths: Mapping[str, Trajectory]) -> str:
    """Returns the run key of the reference run to compare with.

    It is the run with the smallest median distance to all others, which excludes outliers and needs
    no ground truth. Ties go to the first key; runs that cannot be compared with any other come
    last. Raises SlambedError without a run.
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
