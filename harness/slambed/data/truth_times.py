# SPDX-License-Identifier: Apache-2.0
"""Checks during preparation whether ground truth belongs to the frames of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from slambed.data.association import MAX_DIFFERENCE_S, match_nearest, nearest_distance_s
from slambed.data.stamps import NS_PER, UNIT_NAMES, recognized_unit
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError

#: The number of pairs needed to align two paths.
_FEWEST_PAIRS = 3
#: A smaller share of frames with a pose is reported.
_USUAL_SHARE = 0.5
#: Of trajectories: a hundred times faster or slower is still believed.
_USUAL_FPS = 30.0
_FASTEST_POSES_HZ = 2000.0
_DATES_S = 1e8
"""Later times are dates."""

Floats = NDArray[np.float64]


def fitting_truth(
    times_ns: Sequence[int], truth: Trajectory, where: str
) -> tuple[Trajectory, list[str]]:
    """Returns the ground truth in seconds, and remarks on it.

    Raises SlambedError if no frame has a pose close to its time.
    """
    frames_s = np.array(times_ns, dtype=np.float64) * 1e-9
    truth, without_time = _of_this_clock(frames_s, truth, where)
    for unit, ns in NS_PER.items():
        scaled = truth
        if unit != "s":
            scaled = replace(truth, stamps_s=truth.stamps_s * (ns / NS_PER["s"]))
        if unit != "s" and not _is_usual(scaled):
            continue
        if (paired := _paired(frames_s, scaled)) >= min(_FEWEST_PAIRS, len(frames_s)):
            return scaled, without_time + _notes(unit, paired, frames_s, scaled, where)
    if (paired := _paired(frames_s, truth)) > 0:
        return truth, without_time + _notes("s", paired, frames_s, truth, where)
    raise _misfit(frames_s, np.sort(truth.stamps_s), where)


def in_seconds(path: Trajectory, where: str) -> tuple[Trajectory, list[str]]:
    """Returns a trajectory with times in seconds, and a remark if they were in another unit: one in
    which they are dates and their steps those of a camera."""
    counts = [Decimal(repr(float(stamp))) for stamp in path.stamps_s]
    unit = recognized_unit(counts, "s", _USUAL_FPS)
    if unit is None or unit == "s":
        return path, []
    scaled = replace(path, stamps_s=path.stamps_s * (NS_PER[unit] / NS_PER["s"]))
    return scaled, [f"{where}: times are read as {UNIT_NAMES[unit]}"]


def _of_this_clock(frames_s: Floats, truth: Trajectory, where: str) -> tuple[Trajectory, list[str]]:
    """Leaves out poses at time 0 among dates, which were recorded before the clock was known."""
    zero = truth.stamps_s == 0
    if not zero.any() or zero.all() or not len(frames_s) or frames_s.min() < _DATES_S:
        return truth, []
    count = np.count_nonzero(zero)
    return truth.take(np.flatnonzero(~zero)), [
        f"{where}: {count} poses of the ground truth at time 0 are left out"
    ]


def _is_usual(truth: Trajectory) -> bool:
    """Returns whether poses come at a rate that something measures: seconds that are taken for
    milliseconds come a thousand times as fast."""
    steps_s = np.diff(np.sort(truth.stamps_s))
    return len(steps_s) == 0 or float(np.median(steps_s)) >= 1 / _FASTEST_POSES_HZ


def _paired(frames_s: Floats, truth: Trajectory) -> int:
    return len(match_nearest(frames_s, np.sort(truth.stamps_s), MAX_DIFFERENCE_S)[0])


def _notes(unit: str, paired: int, frames_s: Floats, truth: Trajectory, where: str) -> list[str]:
    notes = []
    if unit != "s":
        notes.append(f"{where}: times of the ground truth are read as {UNIT_NAMES[unit]}")
    if paired < max(_FEWEST_PAIRS, _USUAL_SHARE * len(frames_s)):
        notes.append(
            f"{where}: {paired} of {len(frames_s)} frames have a pose of the ground truth within "
            f"{1e3 * MAX_DIFFERENCE_S:g} ms; {_ranges(frames_s, truth.stamps_s)}"
        )
    return notes


def _misfit(frames_s: Floats, poses_s: Floats, where: str) -> SlambedError:
    if not len(poses_s):
        return SlambedError(f"{where}: no pose in the ground truth; remove it to go without")
    ranges = _ranges(frames_s, poses_s)
    if poses_s[-1] < frames_s[0] or poses_s[0] > frames_s[-1]:
        return SlambedError(
            f"{where}: the ground truth does not overlap the frames: {ranges}; use one clock for "
            "both, or remove the ground truth to go without"
        )
    nearest_ms = 1e3 * nearest_distance_s(frames_s, poses_s)
    return SlambedError(
        f"{where}: the ground truth is too sparse: no frame has a pose "
        f"within {1e3 * MAX_DIFFERENCE_S:g} ms, the nearest is {nearest_ms:.3g} ms away; {ranges}; "
        "interpolate it to the times of the frames, or remove it to go without"
    )


def _ranges(frames_s: Floats, poses_s: Floats) -> str:
    return (
        f"frames from {frames_s[0]:.3f} to {frames_s[-1]:.3f} s, "
        f"{len(poses_s)} poses from {poses_s.min():.3f} to {poses_s.max():.3f} s"
    )
