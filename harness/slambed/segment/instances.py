# SPDX-License-Identifier: Apache-2.0
"""One thing found in a picture, and its mask as run lengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: (height, width), True where the thing is.
Mask = NDArray[np.bool_]
#: (17, 3): u and v in pixels, visibility 0 (not there), 1 (hidden), 2 (seen); COCO's order.
Keypoints = NDArray[np.float32]
KEYPOINTS = 17


@dataclass(frozen=True)
class Instance:
    """One thing of a class that the network's file names; `moves`: so the file says."""

    class_index: int
    score: float
    mask: Mask
    moves: bool = True
    keypoints: Keypoints | None = None


@dataclass(frozen=True)
class Segmented:
    """Everything found in one picture, best score first."""

    width: int
    height: int
    instances: tuple[Instance, ...] = ()

    def moving(self) -> Mask:
        """Where anything is that moves."""
        covered = np.zeros((self.height, self.width), dtype=np.bool_)
        for instance in self.instances:
            if instance.moves:
                covered |= instance.mask
        return covered


def runs_of(mask: Mask) -> NDArray[np.uint32]:
    """Lengths out, in, out ... row by row; the first may be 0, no other is."""
    flat = mask.ravel()
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    edges = np.concatenate([[0] if flat[0] else [], [0], changes, [flat.size]])
    return np.diff(edges).astype(np.uint32)


def mask_of(runs: NDArray[np.uint32], width: int, height: int) -> Mask:
    """The mask of these runs; they must add up to the picture."""
    inside = np.arange(len(runs)) % 2 == 1
    return np.repeat(inside, runs).reshape(height, width)
