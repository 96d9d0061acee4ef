# SPDX-License-Identifier: Apache-2.0
"""KITTI's poses: a line of twelve numbers per frame, the 3x4 matrix T_wc row by row."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slambed.data.rotations import check_rotation
from slambed.data.text_file import pose_rows

KITTI_COLUMNS = 12

PoseLine = tuple[int, list[float]]
"""The number of a line in its file, and its numbers."""


def pose_lines(file: Path) -> list[PoseLine]:
    """Returns the lines with a pose. Raises SlambedError for a line of other numbers."""
    return pose_rows(file, KITTI_COLUMNS, "12 numbers, a 3x4 camera-to-world matrix")


def matrices_of(lines: Sequence[PoseLine], file: Path) -> NDArray[np.float64]:
    """Returns the matrices, shape (n, 3, 4). Raises SlambedError for one without a rotation."""
    matrices = np.array([values for _, values in lines], dtype=np.float64).reshape(-1, 3, 4)
    for (line, _), matrix in zip(lines, matrices, strict=True):
        check_rotation(matrix[:, :3], f"{file}:{line}")
    return matrices
