# SPDX-License-Identifier: Apache-2.0
"""A time-stamped camera path, and the two text formats the field exchanges (TUM, KITTI)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from slambed.errors import SlambedError

Floats = NDArray[np.float64]

TUM_COLUMNS = 8  # timestamp tx ty tz qx qy qz qw
KITTI_COLUMNS = 12  # the first three rows of a 4x4 matrix


@dataclass(frozen=True)
class Trajectory:
    """Camera-to-world poses: stamps [N] s, positions [N,3] m, quaternions [N,4] as x y z w."""

    stamps_s: Floats
    positions_m: Floats
    quaternions_xyzw: Floats

    def __len__(self) -> int:
        return len(self.stamps_s)

    def take(self, indices: NDArray[np.intp]) -> "Trajectory":
        """The poses at these indices, in this order."""
        return Trajectory(
            self.stamps_s[indices], self.positions_m[indices], self.quaternions_xyzw[indices]
        )

    def scaled(self, factor: float) -> "Trajectory":
        """The same path in another unit of length."""
        return Trajectory(self.stamps_s, factor * self.positions_m, self.quaternions_xyzw)

    def rotations(self) -> Rotation:
        """All orientations; quaternions are normalised by scipy."""
        return Rotation.from_quat(self.quaternions_xyzw)

    def length_m(self) -> float:
        """Length of the path."""
        return float(np.linalg.norm(np.diff(self.positions_m, axis=0), axis=1).sum())


EMPTY = Trajectory(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 4)))


def read_tum(path: Path) -> Trajectory:
    """Reads `timestamp tx ty tz qx qy qz qw` lines; '#' starts a comment; sorted by time.

    Raises SlambedError when a line is not eight finite numbers or a quaternion is zero.
    """
    rows = _read_rows(path, TUM_COLUMNS, "timestamp tx ty tz qx qy qz qw")
    if len(rows) == 0:
        return EMPTY
    if np.any(np.linalg.norm(rows[:, 4:], axis=1) < 1e-6):
        raise SlambedError(f"a quaternion is zero, in {path}, write unit quaternions (qx qy qz qw)")
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    return Trajectory(rows[:, 0].copy(), rows[:, 1:4].copy(), rows[:, 4:8].copy())


def write_tum(path: Path, trajectory: Trajectory) -> None:
    """Writes the TUM format with enough digits to read the same poses back (evo reads it too)."""
    rows = np.column_stack(
        [trajectory.stamps_s, trajectory.positions_m, trajectory.quaternions_xyzw]
    )
    np.savetxt(path, rows, fmt=["%.9f"] + ["%.9g"] * 7)


def read_kitti(poses: Path, times: Path | None = None) -> Trajectory:
    """Reads KITTI odometry poses (12 numbers a line); without `times`, stamps are line numbers."""
    rows = _read_rows(poses, KITTI_COLUMNS, "12 numbers, a 3x4 matrix row by row")
    stamps = np.arange(len(rows), dtype=np.float64)
    if times is not None:
        stamps = _read_rows(times, 1, "one time in seconds")[:, 0]
        if len(stamps) != len(rows):
            raise SlambedError(
                f"{len(rows)} poses but {len(stamps)} times, in {poses} and {times}, give files "
                "of the same sequence"
            )
    matrices = rows.reshape(-1, 3, 4)
    quaternions = (
        Rotation.from_matrix(matrices[:, :, :3]).as_quat() if len(rows) else np.zeros((0, 4))
    )
    return Trajectory(stamps, matrices[:, :, 3].copy(), quaternions)


def write_kitti(path: Path, trajectory: Trajectory) -> None:
    """Writes the poses alone as KITTI does: 12 numbers a line, no times."""
    matrices = np.concatenate(
        [trajectory.rotations().as_matrix(), trajectory.positions_m[:, :, None]], axis=2
    )
    np.savetxt(path, matrices.reshape(-1, KITTI_COLUMNS), fmt="%.9e")


def _read_rows(path: Path, columns: int, what: str) -> Floats:
    """Numbers of a text file, `columns` a line; says file and line when one is not."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise SlambedError(f"cannot read a trajectory, {path}, {error}") from error
    if (plain := _plain_rows(lines, columns)) is not None:
        return plain
    rows: list[list[float]] = []
    for number, line in enumerate(lines, start=1):
        text = line.split("#", 1)[0].replace(",", " ").split()
        if not text:
            continue
        try:
            values = [float(item) for item in text]
        except ValueError:
            values = []
        if len(values) != columns or not np.all(np.isfinite(values)):
            raise SlambedError(f"not a pose, {path}:{number}, expected {what}")
        rows.append(values)
    return np.array(rows, dtype=np.float64).reshape(-1, columns)


def _plain_rows(lines: list[str], columns: int) -> Floats | None:
    """Of a file as programs write it, at once; None of one that has to be looked at line by line:
    with commas, wrong numbers, or nothing in it."""
    if not any(line and line[0] != "#" for line in lines):
        return None
    try:
        rows = np.loadtxt(lines, dtype=np.float64, comments="#", ndmin=2)
    except ValueError:
        return None
    return rows if rows.size and rows.shape[1] == columns and np.isfinite(rows).all() else None
