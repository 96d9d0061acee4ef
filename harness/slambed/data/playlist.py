# SPDX-License-Identifier: Apache-2.0
"""Determines which frames a playback offers: the plan that the nodes' player follows.

It implements the same rule as `systems/core/node/playback.cpp`; `test_playlist.py` compares the
two.
"""

import numpy as np
from numpy.typing import NDArray

NS_PER_S = 1_000_000_000


def keep_every(recorded_fps: float, fps: float | None) -> int:
    """Returns n, where every n-th frame is offered at the requested rate."""
    # Rounds half away from zero, like std::lround.
    return max(1, int(np.floor(recorded_fps / fps + 0.5))) if fps else 1


def offered_frames(
    times_ns: NDArray[np.integer],
    recorded_fps: float,
    fps: float | None,
    start_s: float,
    end_s: float | None,
) -> NDArray[np.intp]:
    """Returns indices of the offered frames: from `start_s` up to but excluding `end_s`, every
    n-th one, where n is the rounded ratio of recorded to requested rate."""
    inside = times_ns >= round(start_s * NS_PER_S)
    if end_s is not None:
        inside &= times_ns < round(end_s * NS_PER_S)
    return np.flatnonzero(inside)[:: keep_every(recorded_fps, fps)]
