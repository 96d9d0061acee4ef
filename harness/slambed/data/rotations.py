# SPDX-License-Identifier: Apache-2.0
"""Checks whether matrices and quaternions of a file are rotations."""

import numpy as np
from numpy.typing import NDArray

from slambed.errors import SlambedError

#: Tolerance for calibrations and poses with three decimals; a scaled, mirrored or wrongly
#: transposed matrix exceeds it.
_TOLERANCE = 0.02

Floats = NDArray[np.float64]


def check_rotation(matrix: Floats, where: str) -> None:
    """Raises SlambedError if the matrix [3,3] is no rotation."""
    with np.errstate(over="ignore", invalid="ignore"):  # what is so far off is refused below
        apart = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if not apart < _TOLERANCE:
        raise SlambedError(
            f"{where}: not a rotation: its rows are not of length 1 and at right angles "
            f"({apart:.3g} off); expected a rotation matrix; correct or remove the pose"
        )
    if np.linalg.det(matrix) < 0:
        raise SlambedError(f"{where}: a mirror image, not a rotation; check the order of the axes")


def check_pose(matrix: Floats, where: str) -> None:
    """Raises SlambedError if the matrix [4,4] is no pose: its rotation is none, or it is written by
    columns."""
    check_rotation(matrix[:3, :3], where)
    if not np.allclose(matrix[3], [0, 0, 0, 1], atol=1e-3):
        found = " ".join(f"{value:g}" for value in matrix[3])
        raise SlambedError(
            f"{where}: the last row of a pose is {found}, expected 0 0 0 1; is it written by "
            "columns?"
        )


def check_quaternions(quaternions: Floats, where: list[str]) -> None:
    """Raises SlambedError for the first quaternion [N,4] whose length is not 1."""
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(quaternions, axis=1)
    for i in np.flatnonzero(~(np.abs(lengths - 1) < 5 * _TOLERANCE)):
        raise SlambedError(
            f"{where[i]}: not a rotation: the quaternion has length {lengths[i]:.4g}, expected 1; "
            "are the columns in the order that the format has?"
        )
