# SPDX-License-Identifier: Apache-2.0
"""Trajectory text files: TUM format, and KITTI's 3x4 matrices."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slambed.data.model import Trajectory
from slambed.errors import SlambedError


def read_trajectory(path: Path) -> Trajectory:
    """Reads `time tx ty tz qx qy qz qw` lines; '#' comments; time strictly increasing.

    Lines that repeat or precede the time of an earlier line are dropped (the published ground truth
    of TUM RGB-D has a few); anything that is not eight finite numbers is an error.
    """
    rows: list[list[float]] = []
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as broken:
        raise SlambedError(f"{path}: cannot be read as a trajectory ({broken})") from broken
    for number, line in enumerate(text.splitlines(), 1):
        content = line.split("#", 1)[0].replace(",", " ").split()
        if not content:
            continue
        try:
            row = [float(value) for value in content[:8]]
        except ValueError:
            row = []
        if len(row) != 8 or not np.all(np.isfinite(row)) or np.linalg.norm(row[4:]) < 1e-6:
            raise SlambedError(f"{path}:{number}: not a pose; expected 'time tx ty tz qx qy qz qw'")
        if not rows or row[0] > rows[-1][0]:
            rows.append(row)
    if not rows:
        raise SlambedError(f"{path}: no pose in it; expected lines 'time tx ty tz qx qy qz qw'")
    poses = np.array(rows, dtype=np.float64)
    poses[:, 4:] /= np.linalg.norm(poses[:, 4:], axis=1, keepdims=True)
    return poses


def write_trajectory(path: Path, poses: Trajectory) -> None:
    """Writes TUM format: microseconds, micrometres, 1e-9 of a quaternion."""
    lines = ["# timestamp tx ty tz qx qy qz qw (camera to world)"]
    for row in poses:
        position = " ".join(f"{value:.6f}" for value in row[1:4])
        rotation = " ".join(f"{value:.9f}" for value in row[4:8])
        lines.append(f"{row[0]:.6f} {position} {rotation}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def trajectory_from_matrices(
    times_s: NDArray[np.float64], matrices: NDArray[np.float64]
) -> Trajectory:
    """Camera-to-world matrices (n, 3, 4) or (n, 4, 4) with their times as a trajectory."""
    quaternions = np.array([_quaternion(matrix[:3, :3]) for matrix in matrices])
    return np.column_stack([times_s, matrices[:, :3, 3], quaternions])


def _quaternion(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit quaternion (x, y, z, w) of a rotation matrix: eigenvector form (Bar-Itzhack 2000)."""
    r = rotation
    k = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]],
            [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]],
            [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]],
        ]
    )
    quaternion: NDArray[np.float64] = np.linalg.eigh(k)[1][:, -1]
    return quaternion if quaternion[3] >= 0 else -quaternion
