# SPDX-License-Identifier: Apache-2.0
"""Relative errors per path length as in KITTI's benchmark (Geiger et al., CVPR 2012): segments
of 100, 200, ... 800 m of the true path start at every tenth pose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slambed.data.trajectory import Trajectory
from slambed.metrics.accuracy import product
from slambed.metrics.association import associate

LENGTHS_M = tuple(range(100, 801, 100))
SHORT_LENGTHS_M = tuple(range(10, 81, 10))
"""A tenth of these lengths, for paths shorter than the benchmark's shortest segment; reported as
separate metrics."""
EVERY = 10
"""Poses between two segment starts, as in the benchmark's own program."""


@dataclass(frozen=True)
class KittiError:
    """Means over all segments of all lengths."""

    translation_percent: float
    rotation_deg_per_m: float
    short: bool
    """True for segments of SHORT_LENGTHS_M."""


def kitti_error(estimate: Trajectory, truth: Trajectory) -> KittiError | None:
    """Evaluates an estimate in meters; None if no segment has poses at both ends. The complete
    true path determines the segment lengths, so that an early track loss does not change them."""
    own, true = associate(estimate, truth)
    if len(own) < 2:
        return None
    steps_m = np.linalg.norm(np.diff(true.positions_m, axis=0), axis=1)
    driven_m = np.concatenate([[0.0], np.cumsum(steps_m)])
    lengths_m = LENGTHS_M if truth.length_m() >= LENGTHS_M[0] else SHORT_LENGTHS_M
    start, end, length_m = _parts(driven_m, lengths_m)
    if not len(start):
        return None
    turns_true, turns_own = true.rotations(), own.rotations()
    back_true, back_own = turns_true[start].inv(), turns_own[start].inv()
    step_true = back_true.apply(true.positions_m[end] - true.positions_m[start])
    step_own = back_own.apply(own.positions_m[end] - own.positions_m[start])
    turn_true = product(back_true, turns_true[end])
    turn = product(turn_true.inv(), product(back_own, turns_own[end])).magnitude()
    # The error motion is relative to the true end pose: its length equals that of the difference.
    away_m = np.linalg.norm(step_own - step_true, axis=1)
    return KittiError(
        translation_percent=float(100 * np.mean(away_m / length_m)),
        rotation_deg_per_m=float(np.mean(np.degrees(turn) / length_m)),
        short=lengths_m == SHORT_LENGTHS_M,
    )


def _parts(
    driven_m: NDArray[np.float64], lengths_m: tuple[int, ...]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Returns first and last pose and the nominal length of each segment."""
    starts = np.arange(0, len(driven_m), EVERY)
    start, wanted = (a.ravel() for a in np.meshgrid(starts, lengths_m, indexing="ij"))
    end = np.searchsorted(driven_m, driven_m[start] + wanted, side="right")
    whole = end < len(driven_m)
    return start[whole], end[whole], wanted[whole].astype(np.float64)
