# SPDX-License-Identifier: Apache-2.0
"""Instances in an image, and their masks as run lengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: (height, width), True inside the instance.
Mask = NDArray[np.bool_]
#: (17, 3): u and v in pixels, visibility 0 (absent), 1 (hidden), 2 (visible); COCO's order.
Keypoints = NDArray[np.float32]
KEYPOINTS = 17


@dataclass(frozen=True)
class Instance:
    """One instance of a class of the network; `moves` if its catalog file lists the class as
    moving."""

    class_index: int
    score: float
    mask: Mask
    moves: bool = True
    keypoints: Keypoints | None = None


@dataclass(frozen=True)
class Segmented:
    """All instances in one image, best score first."""

    width: int
    height: int
    instances: tuple[Instance, ...] = ()

    def moving(self) -> Mask:
        """Returns the union of the masks of moving instances."""
        covered = np.zeros((self.height, self.width), dtype=np.bool_)
        for instance in self.instances:
            if instance.moves:
                covered |= instance.mask
        return covered


def runs_of(mask: Mask) -> NDArray[np.uint32]:
    """Returns run lengths outside, inside, outside, ... in row order; only the first may be 0."""
    flat = mask.ravel()
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    edges = np.concatenate([[0] if flat[0] else [], [0], changes, [flat.size]])
    return np.diff(edges).astype(np.uint32)


def mask_of(runs: NDArray[np.uint32], width: int, height: int) -> Mask:
    """Returns the mask of these runs, which must add up to the image."""
    inside = np.arange(len(runs)) % 2 == 1
    return np.repeat(inside, runs).reshape(height, width)
