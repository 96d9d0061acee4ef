# SPDX-License-Identifier: Apache-2.0
"""Draws a path with the alignment of the number beside it, and the truth where it was played."""

import numpy as np

from slambed.data.trajectory import Trajectory
from slambed.metrics.accuracy import Alignment, align_umeyama
from slambed.metrics.association import associate

WORDS = {"se3": "rotation and translation, no scale", "sim3": "with its scale, Sim(3)"}


def alignment_of(estimate: Trajectory, truth: Trajectory, kind: object) -> Alignment:
    """What moves the estimate onto the truth; `kind` is the run's `ate_alignment`, which says
    whether its scale was free. Raises SlambedError with too few poses."""
    pair = associate(estimate, truth)
    return align_umeyama(pair[0].positions_m, pair[1].positions_m, with_scale=kind == "sim3")


def played(truth: Trajectory, paths: list[Trajectory]) -> Trajectory:
    """The part of the true path during which one of the estimates has poses."""
    paths = [path for path in paths if len(path)]
    if not paths:
        return truth
    begin_s = min(path.stamps_s[0] for path in paths) - 1e-3
    end_s = max(path.stamps_s[-1] for path in paths) + 1e-3
    inside = np.flatnonzero((truth.stamps_s >= begin_s) & (truth.stamps_s <= end_s))
    return truth.take(inside) if len(inside) > 1 else truth
