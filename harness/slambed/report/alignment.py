# SPDX-License-Identifier: Apache-2.0
"""Alignment and ground truth for drawings of paths, consistent with the ATE next to them."""

import numpy as np

from slambed.data.trajectory import Trajectory
from slambed.metrics.accuracy import Alignment, align_umeyama
from slambed.metrics.association import associate

WORDS = {"se3": "rotation and translation, no scale", "sim3": "with its scale, Sim(3)"}


def alignment_of(estimate: Trajectory, truth: Trajectory, kind: object) -> Alignment:
    """Returns the alignment of the estimate to the ground truth; `kind` is the run's
    `ate_alignment` (`sim3`: free scale). Raises SlambedError with too few poses."""
    pair = associate(estimate, truth)
    return align_umeyama(pair[0].positions_m, pair[1].positions_m, with_scale=kind == "sim3")


def played(truth: Trajectory, paths: list[Trajectory]) -> Trajectory:
    """Returns the part of the ground truth during which an estimate has poses."""
    paths = [path for path in paths if len(path)]
    if not paths:
        return truth
    begin_s = min(path.stamps_s[0] for path in paths) - 1e-3
    end_s = max(path.stamps_s[-1] for path in paths) + 1e-3
    inside = np.flatnonzero((truth.stamps_s >= begin_s) & (truth.stamps_s <= end_s))
    return truth.take(inside) if len(inside) > 1 else truth
