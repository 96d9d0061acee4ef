# SPDX-License-Identifier: Apache-2.0
"""EuRoC MAV (ASL) folders: mav0/cam0, mav0/cam1, mav0/state_groundtruth_estimate0."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from slambed.data.association import pairs_of_sensors
from slambed.data.images import read_grey
from slambed.data.model import Camera, Frame, GreyImage
from slambed.data.readers.base import FolderReader, ReaderOptions, require
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError
from slambed.yaml_text import read_yaml


class Reader(FolderReader):
    """Stereo, rectified here from the two sensor.yaml.

    The rectified camera is the dataset file's `camera` (OpenCV's own choice of it changed between
    versions) or, without one, the one that keeps no invalid pixels. Ground truth is moved
    from the body (IMU) to the rectified left camera.
    """

    def __init__(self, path: Path, options: ReaderOptions) -> None:
        super().__init__(path, options)
        self._mav = path / "mav0" if (path / "mav0").is_dir() else path
        lists = [_image_list(self._mav / name) for name in ("cam0", "cam1")]
        pairs = pairs_of_sensors([t for t, _ in lists[0]], [t for t, _ in lists[1]], 1e-3)
        self._frames = [(lists[0][i][0], lists[0][i][1], lists[1][j][1]) for i, j in pairs]
        if not self._frames:
            raise SlambedError(f"{self._mav}: cam0 and cam1 have no time in common")
        self._sensors = [_sensor(self._mav / name) for name in ("cam0", "cam1")]
        self._rectify()

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, i: int) -> Frame:
        time_ns, left, right = self._frames[i]
        return Frame(time_ns, self._remap(left, 0), self._remap(right, 1))

    def files(self) -> Iterable[Path]:
        for name in ("cam0", "cam1"):
            yield self._mav / name / "sensor.yaml"
        if (poses := self._poses_file()).is_file():
            yield poses
        for _, left, right in self._frames:
            yield left
            yield right

    def size(self) -> tuple[int, int]:
        return self._size

    def camera(self) -> Camera:
        p0, p1 = self._projections
        return Camera(fx=p0[0, 0], fy=p0[1, 1], cx=p0[0, 2], cy=p0[1, 2], bf=-p1[0, 3])

    def trajectory(self) -> Trajectory | None:
        file = self._poses_file()
        if not file.is_file():
            return None
        rows = np.loadtxt(file, delimiter=",", comments="#", ndmin=2)[:, :8]
        w, x, y, z = rows[:, 4:8].T
        rotations = np.moveaxis(
            np.array(
                [
                    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
                ]
            ),
            2,
            0,
        )
        world_body = np.tile(np.eye(4), (len(rows), 1, 1))
        world_body[:, :3, :3] = rotations
        world_body[:, :3, 3] = rows[:, 1:4]
        raw_rectified = np.eye(4)
        raw_rectified[:3, :3] = self._rotations[0].T
        body_camera = self._sensors[0]["T_BS"] @ raw_rectified
        return Trajectory.of_matrices(rows[:, 0] * 1e-9, world_body @ body_camera)

    def _rectify(self) -> None:
        a, b = self._sensors
        self._size: tuple[int, int] = a["resolution"]
        right_left = np.linalg.inv(b["T_BS"]) @ a["T_BS"]
        rotation, translation = right_left[:3, :3].copy(), right_left[:3, 3:].copy()
        r0, r1, p0, p1, *_ = cv2.stereoRectify(
            a["K"], a["D"], b["K"], b["D"], self._size, rotation, translation,
            flags=cv2.CALIB_ZERO_DISPARITY, alpha=0,
        )  # fmt: skip
        if (camera := self.options.camera) is not None:
            baseline_m = -p1[0, 3] / p1[0, 0]
            p0 = np.array(
                [[camera.fx, 0, camera.cx, 0], [0, camera.fy, camera.cy, 0], [0, 0, 1.0, 0]]
            )
            p1 = p0.copy()
            p1[0, 3] = -camera.fx * baseline_m
        self._rotations, self._projections = (r0, r1), (p0, p1)
        self._maps = [
            cv2.initUndistortRectifyMap(s["K"], s["D"], r, p, self._size, cv2.CV_32FC1)
            for s, r, p in ((a, r0, p0), (b, r1, p1))
        ]

    def _remap(self, file: Path, side: int) -> GreyImage:
        image = read_grey(file, self._size)
        map_x, map_y = self._maps[side]
        warped = cv2.remap(image, map_x, map_y, interpolation=cv2.INTER_LINEAR)
        return np.asarray(warped, dtype=np.uint8)

    def _poses_file(self) -> Path:
        return self._mav / "state_groundtruth_estimate0" / "data.csv"


def _image_list(folder: Path) -> list[tuple[int, Path]]:
    with require(folder / "data.csv", "list of images").open(newline="") as file:
        rows = [row for row in csv.reader(file) if row and not row[0].startswith("#")]
    return sorted((int(row[0]), folder / "data" / row[1].strip()) for row in rows)


def _sensor(folder: Path) -> dict[str, Any]:
    file = require(folder / "sensor.yaml", "calibration")
    try:
        raw = read_yaml(file.read_text())
        fu, fv, cu, cv = raw["intrinsics"]
        return {
            "K": np.array([[fu, 0, cu], [0, fv, cv], [0, 0, 1]], dtype=np.float64),
            "D": np.array(raw["distortion_coefficients"], dtype=np.float64),
            "T_BS": np.array(raw["T_BS"]["data"], dtype=np.float64).reshape(4, 4),
            "resolution": (int(raw["resolution"][0]), int(raw["resolution"][1])),
        }
    except (yaml.YAMLError, KeyError, TypeError, ValueError) as broken:
        raise SlambedError(f"{file}: not an ASL camera calibration ({broken})") from broken
