# SPDX-License-Identifier: Apache-2.0
"""KITTI odometry: sequences/NN/{image_0,image_1,times.txt,calib.txt}, poses/NN.txt."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from slambed.data.images import read_gray
from slambed.data.kitti_poses import matrices_of, pose_lines
from slambed.data.lens import LARGEST_SKEW_PX
from slambed.data.model import Camera, Frame
from slambed.data.readers.base import (
    PICTURES,
    FolderReader,
    ReaderOptions,
    first_missing,
    number_of,
    numbered,
    require,
    require_poses,
)
from slambed.data.text_file import is_header, read_lines
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError
from slambed.files.outputs import is_file

_PROJECTION = "12 numbers, a 3x4 projection"


class Reader(FolderReader):
    """Rectified gray stereo (or left only, sensor mono); the camera comes from calib.txt.

    The path is sequences/NN. The ground truth is searched there, then in ../../poses. If images are
    missing, times and poses are assigned by image number.

    reader_options: time_unit (s).
    """

    known_options = ("time_unit",)
    sensors = ("stereo", "mono")
    takes_distortion = False

    def __init__(self, path: Path, options: ReaderOptions) -> None:
        super().__init__(path, options)
        if options.camera is not None:
            self.notes.append(f"{path}: 'camera' of the dataset file is not used, calib.txt has it")
        self._calibration = require(path / "calib.txt", "calibration")
        self._times_file = require(path / "times.txt", "times of the frames")
        self._left = numbered(path / "image_0", "", PICTURES)
        if not self._left:
            raise SlambedError(
                f"{path / 'image_0'}: no PNG or JPEG images; unpack the gray images there"
            )
        if options.sensor == "stereo":
            require(path / "image_1", "right gray images; 'sensor: mono' works without")
        self._lines, self._times_ns = self._read_times()
        missing, first = first_missing(self._left)
        if missing:
            by = "line, as there are as many as images" if self._by_line else "number"
            self.notes.append(
                f"{path / 'image_0'}: {missing} images are missing, the first is number {first}; "
                f"times and poses go by {by}"
            )
        height, width = read_gray(self._left[0], None, self.gray_range).shape
        self._size = (width, height)

    def __len__(self) -> int:
        return len(self._left)

    def __getitem__(self, i: int) -> Frame:
        left = read_gray(self._left[i], self._size, self.gray_range)
        right = None
        if self.options.sensor == "stereo":
            right = read_gray(self._right(i), self._size, self.gray_range)
        return Frame(self._times_ns[i], left, right)

    def times_ns(self) -> list[int]:
        return self._times_ns

    def place(self, i: int) -> str:
        return f"{self._times_file}:{self._lines[i]}"

    def files(self) -> Iterable[Path]:
        yield self._calibration
        yield self._times_file
        if (poses := self._poses_file()) is not None:
            yield poses
        yield from self._left
        if self.options.sensor == "stereo":
            yield from (self._right(i) for i in range(len(self)))

    def size(self) -> tuple[int, int]:
        return self._size

    def camera(self) -> Camera:
        """From P0 and P1 of calib.txt: bf is minus the fourth entry of P1. One camera needs no
        P1."""
        line0, p0 = self._projection("P0")
        if not (p0[0, 0] > 0 and p0[1, 1] > 0):
            raise SlambedError(
                f"{self._calibration}:{line0}: the focal lengths of P0 are {p0[0, 0]:g} and "
                f"{p0[1, 1]:g}, expected to be above 0; fetch the file again"
            )
        pinhole = {"fx": p0[0, 0], "fy": p0[1, 1], "cx": p0[0, 2], "cy": p0[1, 2]}
        is_stereo = self.options.sensor == "stereo"
        if not is_stereo and not self._lines_of("P1"):
            return Camera(**pinhole, bf=0.0)
        line1, p1 = self._projection("P1")
        if is_stereo and not np.allclose(p0[:, :3], p1[:, :3], atol=1e-3):
            raise SlambedError(
                f"{self._calibration}:{line1}: P0 and P1 differ in more than their fourth column, "
                "so the pictures are not rectified; rectify them, or take 'sensor: mono'"
            )
        bf = p0[0, 3] - p1[0, 3]
        if bf <= 0 and is_stereo:
            raise SlambedError(
                f"{self._calibration}:{line1}: the fourth number of P1 is {p1[0, 3]:g}, expected "
                f"below {p0[0, 3]:g} (minus fx times baseline): the right camera is not to the "
                "right of the left one; correct the file or swap image_0 and image_1"
            )
        return Camera(**pinhole, bf=max(bf, 0.0))

    def trajectory(self) -> Trajectory | None:
        file = self._poses_file()
        if file is None:
            return None
        lines = pose_lines(file)
        chosen = [lines[k] for k in self._places_in(len(lines), file, "poses")]
        matrices = matrices_of(chosen, file)
        return Trajectory.of_matrices(np.array(self._times_ns) * 1e-9, matrices)

    def _read_times(self) -> tuple[list[int], list[int]]:
        """Returns line number and time of every image."""
        rows = [
            (number, line.strip().rstrip(",;"))
            for number, line in enumerate(read_lines(self._times_file), 1)
            if line.strip() and not line.startswith("#")
        ]
        if rows and is_header(rows[0][1].split()):
            rows = rows[1:]
        # One time per line, a date with a time of day, or all times in one line.
        if len(rows) == 1 and len(self._left) > 1:
            rows = [(rows[0][0], word) for word in rows[0][1].split()]
        self._by_line = len(rows) == len(self._left)
        chosen = [rows[k] for k in self._places_in(len(rows), self._times_file, "times")]
        return [line for line, _ in chosen], self._in_ns(self._times_file, chosen, "s")

    def _places_in(self, count: int, file: Path, what: str) -> list[int]:
        """Returns the rows that belong to the images: by image number, or by position if both
        images and rows were removed."""
        numbers = [-1 if (n := number_of(image)) is None else n for image in self._left]
        if count != len(numbers) and min(numbers) >= 0 and max(numbers) < count:
            return numbers
        if count == len(numbers) or (min(numbers) < 0 and count > len(numbers)):
            return list(range(len(numbers)))
        raise SlambedError(
            f"{file}: {count} {what} for {len(numbers)} images, the last is "
            f"{self._left[-1].name}; expected a line for each; fetch the file again"
        )

    def _lines_of(self, wanted: str) -> list[tuple[int, str]]:
        """Returns number and values of the lines of calib.txt with this name."""
        return [
            (number, values)
            for number, line in enumerate(read_lines(self._calibration), 1)
            for name, _, values in [line.partition(":")]
            if name.strip() == wanted
        ]

    def _projection(self, wanted: str) -> tuple[int, np.ndarray]:
        """Returns the number of a line of calib.txt and its matrix [3,4]."""
        found = self._lines_of(wanted)
        if not found:
            raise SlambedError(
                f"{self._calibration}: no line {wanted} with {_PROJECTION}; complete it"
            )
        where = f"{self._calibration}:{found[-1][0]}"
        if len(found) > 1:
            raise SlambedError(f"{where}: {wanted} is given twice; remove one of the lines")
        number, values = found[0]
        try:
            matrix = np.array([float(value) for value in values.split()])
        except ValueError as broken:
            raise SlambedError(
                f"{where}: {broken}, expected {_PROJECTION}; fetch the file again"
            ) from None
        if matrix.shape != (12,) or not np.isfinite(matrix).all():
            raise SlambedError(
                f"{where}: {len(matrix)} values, expected {_PROJECTION}; fetch the file again"
            )
        projection = matrix.reshape(3, 4)
        if abs(skew := projection[0, 1]) > LARGEST_SKEW_PX:
            raise SlambedError(
                f"{where}: {wanted} has the skew {skew:g}, expected 0, as of rectified pictures; "
                "fetch the file again"
            )
        if not np.allclose(projection[2], [0, 0, 1, 0]):
            raise SlambedError(
                f"{where}: the last row of {wanted} is "
                f"{' '.join(f'{value:g}' for value in projection[2])}, expected 0 0 1 0; "
                "fetch the file again"
            )
        return number, projection

    def _poses_file(self) -> Path | None:
        if not self.options.groundtruth:
            return None
        beside = self.path / self.options.groundtruth
        if is_file(beside):
            return beside
        return require_poses(self.path.parent.parent / "poses" / self.options.groundtruth)

    def _right(self, i: int) -> Path:
        return self.path / "image_1" / self._left[i].name
