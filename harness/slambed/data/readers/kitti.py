# SPDX-License-Identifier: Apache-2.0
"""KITTI odometry: sequences/NN/{image_0,image_1,times.txt,calib.txt}, poses/NN.txt."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from slambed.data.images import read_grey
from slambed.data.model import Camera, Frame
from slambed.data.readers.base import FolderReader, ReaderOptions, require, seconds_to_ns
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError


class Reader(FolderReader):
    """Rectified grey stereo (or left only, sensor mono); the camera comes from calib.txt.

    The path is sequences/NN. groundtruth is searched there, then in ../../poses.
    """

    def __init__(self, path: Path, options: ReaderOptions) -> None:
        super().__init__(path, options)
        self._calibration = require(path / "calib.txt", "calibration")
        self._times_file = require(path / "times.txt", "times of the frames")
        self._left = sorted((path / "image_0").glob("*.png"))
        if not self._left:
            raise SlambedError(f"{path / 'image_0'}: no PNG images; unpack the grey images there")
        if options.sensor == "stereo":
            require(path / "image_1", "right grey images; 'sensor: mono' works without")
        self._times_ns = [seconds_to_ns(t) for t in self._times_file.read_text().split()]
        if len(self._times_ns) < len(self._left):
            raise SlambedError(
                f"{self._times_file}: {len(self._times_ns)} times for {len(self._left)} images; "
                "fetch the file again"
            )
        height, width = read_grey(self._left[0]).shape
        self._size = (width, height)

    def __len__(self) -> int:
        return len(self._left)

    def __getitem__(self, i: int) -> Frame:
        left = read_grey(self._left[i], self._size)
        right = None if self.options.sensor == "mono" else read_grey(self._right(i), self._size)
        return Frame(self._times_ns[i], left, right)

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
        """From P0 and P1 of calib.txt: bf is minus the fourth entry of P1."""
        matrices = {}
        for line in self._calibration.read_text().splitlines():
            name, _, values = line.partition(":")
            if name in ("P0", "P1"):
                matrices[name] = np.array([float(v) for v in values.split()])
        if any(matrices.get(name, np.empty(0)).shape != (12,) for name in ("P0", "P1")):
            raise SlambedError(f"{self._calibration}: lines P0 and P1 with 12 numbers are needed")
        p0, p1 = matrices["P0"].reshape(3, 4), matrices["P1"].reshape(3, 4)
        return Camera(fx=p0[0, 0], fy=p0[1, 1], cx=p0[0, 2], cy=p0[1, 2], bf=-p1[0, 3])

    def trajectory(self) -> Trajectory | None:
        file = self._poses_file()
        if file is None:
            return None
        matrices = np.loadtxt(file, dtype=np.float64, ndmin=2)[: len(self)]
        if matrices.shape != (len(self), 12):
            raise SlambedError(f"{file}: {len(self)} lines with 12 numbers are needed")
        times_s = np.array(self._times_ns[: len(self)]) * 1e-9
        return Trajectory.of_matrices(times_s, matrices.reshape(-1, 3, 4))

    def _poses_file(self) -> Path | None:
        if not self.options.groundtruth:
            return None
        for folder in (self.path, self.path.parent.parent / "poses"):
            if (file := folder / self.options.groundtruth).is_file():
                return file
        return None

    def _right(self, i: int) -> Path:
        return self.path / "image_1" / self._left[i].name
