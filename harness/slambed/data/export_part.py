# SPDX-License-Identifier: Apache-2.0
"""The part of a sequence to be exported."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slambed.data.model import Frame
from slambed.data.prepared import PreparedSequence
from slambed.data.trajectory import Trajectory

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Part:
    """The exported part of a sequence."""

    sequence: PreparedSequence
    indices: NDArray[np.intp]
    """Indices of its frames, in order."""
    with_truth: bool
    progress: Progress | None

    def frames(self) -> Iterator[Frame]:
        """Yields the frames; reports the progress of each."""
        for done, index in enumerate(self.indices, start=1):
            yield self.sequence[int(index)]
            if self.progress is not None:
                self.progress(done, len(self.indices))

    @property
    def fps(self) -> float:
        """Frame rate of the selected frames."""
        steps = np.diff(self.indices)
        return self.sequence.info.fps / (float(np.median(steps)) if len(steps) else 1.0)

    @property
    def recorded_s(self) -> NDArray[np.float64]:
        """Recorded times of the selected frames, which the ground truth uses."""
        times_s = self.sequence.info.time_origin_s + self.sequence.times_s[self.indices]
        return np.asarray(times_s, dtype=np.float64)

    def truth(self) -> Trajectory | None:
        """Returns the ground truth, if it exists and is exported."""
        return self.sequence.groundtruth() if self.with_truth else None
