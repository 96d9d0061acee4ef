# SPDX-License-Identifier: Apache-2.0
"""A camera trajectory, and TUM's text format for it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from slambed.data.pose_columns import PoseColumns, named_columns
from slambed.data.stamps import NS_PER
from slambed.data.text_file import pose_rows, read_lines, table_lines
from slambed.errors import SlambedError

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]

COLUMNS = 8
EXPECTED = "expected 'time tx ty tz qx qy qz qw'"
USUAL = PoseColumns(tuple(range(COLUMNS)), None)
_POSITIONS_ALONE = "# positions alone, orientations are unknown"
FARTHEST_TRUTH_M = 1e9
"""Of a ground truth; it is further than any place on Earth from any origin in use."""
_DATES_NS = 1e17
"""Later times are nanoseconds since 1970."""
LATEST = float(2**63)
"""Largest time, whose unit may be the nanosecond."""


@dataclass(frozen=True, repr=False)
class Trajectory:
    """Camera-to-world poses: stamps [N] s, positions [N,3] m, quaternions [N,4] as x y z w."""

    stamps_s: Floats
    positions_m: Floats
    quaternions_xyzw: Floats
    has_orientation: bool = True
    """False where only positions were recorded; all quaternions are the identity then."""

    @classmethod
    def of_rows(cls, rows: Floats) -> Trajectory:
        """Creates a trajectory from rows in TUM's order [N,8]."""
        return cls(rows[:, 0].copy(), rows[:, 1:4].copy(), rows[:, 4:8].copy())

    @classmethod
    def of_matrices(cls, stamps_s: Floats, matrices: Floats) -> Trajectory:
        """Creates a trajectory from camera-to-world matrices [N,3,4] or [N,4,4]."""
        quaternions = np.array([_quaternion(matrix[:3, :3]) for matrix in matrices])
        return cls(stamps_s, matrices[:, :3, 3], quaternions)

    def __len__(self) -> int:
        return len(self.stamps_s)

    def __repr__(self) -> str:
        lasts_s = float(self.stamps_s[-1] - self.stamps_s[0]) if len(self) else 0.0
        return f"Trajectory(poses={len(self)}, seconds={lasts_s:.1f})"

    def rows(self) -> Floats:
        """Returns rows in TUM's order [N,8]."""
        return np.column_stack([self.stamps_s, self.positions_m, self.quaternions_xyzw])

    def take(self, indices: NDArray[np.intp]) -> Trajectory:
        """Returns the poses at these indices, in this order."""
        return replace(
            self,
            stamps_s=self.stamps_s[indices],
            positions_m=self.positions_m[indices],
            quaternions_xyzw=self.quaternions_xyzw[indices],
        )

    def scaled(self, factor: float) -> Trajectory:
        """Returns the path with scaled positions."""
        return replace(self, positions_m=factor * self.positions_m)

    def rotations(self) -> Rotation:
        """Returns all orientations; scipy normalizes the quaternions."""
        from scipy.spatial.transform import Rotation  # slow to import, and not needed for reading

        return Rotation.from_quat(self.quaternions_xyzw)

    def length_m(self) -> float:
        """Returns the length of the path."""
        return float(np.linalg.norm(np.diff(self.positions_m, axis=0), axis=1).sum())


EMPTY = Trajectory(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 4)))


def read_tum(path: Path) -> Trajectory:
    """Reads `time tx ty tz qx qy qz qw` lines sorted by time; '#' starts a comment. A header may
    name another order and a unit of time. Duplicates are kept, and quaternions are not normalized.

    Raises SlambedError if a line is not eight finite numbers or a quaternion is zero.
    """
    lines = read_lines(path)
    rows = _rows_of(path, lines)
    if len(rows) == 0:
        return EMPTY
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(rows[:, 4:], axis=1)
    if (wrong := np.flatnonzero((lengths < 1e-6) | (lengths > 1e6))).size:
        raise SlambedError(
            f"{path}: not a pose, the quaternion at {rows[wrong[0], 0]:.6f} s has length "
            f"{lengths[wrong[0]]:g}; {EXPECTED}"
        )
    found = Trajectory.of_rows(rows[np.argsort(rows[:, 0], kind="stable")])
    return replace(found, has_orientation=_POSITIONS_ALONE not in lines)


def read_groundtruth(path: Path) -> Trajectory:
    """Reads a file like read_tum, as ground truth."""
    return as_groundtruth(read_tum(path), path)


def as_groundtruth(found: Trajectory, path: Path) -> Trajectory:
    """Returns what was read from `path` with times that strictly increase (of poses with the same
    time, which occur in TUM's files, the first is kept) and quaternions of length 1.

    Raises SlambedError without a pose, or with one that is too far away.
    """
    if not len(found):
        raise SlambedError(f"{path}: no pose in it; {EXPECTED}")
    if (farthest := float(np.abs(found.positions_m).max())) > FARTHEST_TRUTH_M:
        raise SlambedError(f"{path}: a pose is {farthest:g} m away, expected meters; correct it")
    once = found.take(np.flatnonzero(np.diff(found.stamps_s, prepend=-np.inf) > 0))
    lengths = np.linalg.norm(once.quaternions_xyzw, axis=1, keepdims=True)
    return replace(once, quaternions_xyzw=once.quaternions_xyzw / lengths)


def repeated_times(path: Trajectory) -> int:
    """Returns how many poses of a sorted trajectory have the time of the one before and another
    place or orientation."""
    again = np.diff(path.stamps_s) == 0
    differs = np.any(np.diff(path.rows()[:, 1:], axis=0) != 0, axis=1)
    return int(np.count_nonzero(again & differs))


def write_tum(path: Path, trajectory: Trajectory) -> None:
    """Writes TUM's format with precision 1 us, 1 um, and 1e-9 for quaternions. A comment tells
    where only positions are known."""
    lines = ["# timestamp tx ty tz qx qy qz qw (camera to world)"]
    lines += [] if trajectory.has_orientation else [_POSITIONS_ALONE]
    for row in trajectory.rows():
        position = " ".join(f"{value:.6f}" for value in row[1:4])
        rotation = " ".join(f"{value:.9f}" for value in row[4:8])
        lines.append(f"{row[0]:.6f} {position} {rotation}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _rows_of(path: Path, lines: list[str]) -> Floats:
    """Returns the numbers of the file, with times in the unit that a header names as seconds."""
    named = named_columns(lines, str(path)) or USUAL
    rows = _plain_rows(lines) if named.order == USUAL.order else None
    if rows is None:
        rows = _ordered_rows(path, named)
        if named is USUAL and len(rows) and rows[0, 0] > _DATES_NS and _has_commas(path):
            raise SlambedError(
                f"{path}: nanoseconds and commas without a header: is qw first, as EuRoC has it, "
                "or last? Add a first line, as '#timestamp [ns], x, y, z, qw, qx, qy, qz'"
            )
    if (ns := NS_PER.get(named.unit or "s", NS_PER["s"])) != NS_PER["s"]:
        rows[:, 0] *= ns / NS_PER["s"]
    return rows


def _has_commas(path: Path) -> bool:
    return any("," in line for _, line in table_lines(path))


def _ordered_rows(path: Path, named: PoseColumns) -> Floats:
    """Returns the numbers of a table whose header names its columns; errors name the line."""
    rows = []
    expected = EXPECTED.removeprefix("expected ")
    # Columns behind those that a header names are covariances.
    table = pose_rows(path, named.count, expected, longer=named is not USUAL)
    for number, found in table:
        values = [found[place] for place in named.order]
        if abs(values[0]) > LATEST:
            raise SlambedError(f"{path}:{number}: {values[0]:g} is not a time; {EXPECTED}")
        rows.append(values)
    return np.array(rows, dtype=np.float64).reshape(-1, COLUMNS)


def _plain_rows(lines: list[str]) -> Floats | None:
    """Parses a regular file at once; returns None for a file that must be parsed by line: with
    commas, malformed numbers, or no rows."""
    if not any((word := line.lstrip()) and word[0] != "#" for line in lines):
        return None
    try:
        rows = np.loadtxt(lines, dtype=np.float64, comments="#", ndmin=2)
    except ValueError:
        return None
    if not rows.size or rows.shape[1] != COLUMNS or not np.isfinite(rows).all():
        return None
    return rows if np.abs(rows[:, 0]).max() <= LATEST else None


def _quaternion(rotation: Floats) -> Floats:
    """Returns the unit quaternion (x, y, z, w) of a rotation matrix: eigenvector form
    (Bar-Itzhack 2000)."""
    r = rotation
    k = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]],
            [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]],
            [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]],
        ]
    )
    quaternion: Floats = np.linalg.eigh(k)[1][:, -1]
    return quaternion if quaternion[3] >= 0 else -quaternion
