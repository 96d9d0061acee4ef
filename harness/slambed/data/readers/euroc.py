# SPDX-License-Identifier: Apache-2.0
"""EuRoC MAV (ASL) folders: mav0/cam0, mav0/cam1, mav0/state_groundtruth_estimate0; also TUM-VI
with mav0/mocap0."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from slambed.data.association import pairs_of_sensors
from slambed.data.camera_files import CalibratedCamera, read_asl
from slambed.data.images import read_gray
from slambed.data.lens import rectified
from slambed.data.model import Camera, Frame, GrayImage
from slambed.data.pose_columns import PoseColumns, named_columns
from slambed.data.readers.base import FolderReader, ReaderOptions, require, require_poses
from slambed.data.rotations import check_quaternions
from slambed.data.stamps import NS_PER, UNIT_NAMES, recognized_unit
from slambed.data.text_file import pose_rows, read_lines, table_lines
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError
from slambed.files.outputs import is_file

_POSE = "time, x, y, z, qw, qx, qy, qz"
#: Between time and file; the name of a file may contain blanks.
_SEPARATOR = re.compile(r"\s*[,;]\s*|\s+")
#: Nominal rate of ground truth.
_POSES_PER_S = 100.0
_COLUMNS = PoseColumns((0, 1, 2, 3, 5, 6, 7, 4), "ns")
#: Poses of the body, which is the IMU; TUM-VI's motion capture also refers to the IMU.
_POSES = ("state_groundtruth_estimate0/data.csv", "mocap0/data.csv")


@dataclass(frozen=True)
class _Image:
    """A line of data.csv."""

    time_ns: int
    file: Path
    line: int


class Reader(FolderReader):
    """Stereo, rectified with the two sensor.yaml, or cam0 alone (sensor mono), undistorted.

    The rectified camera is the dataset file's `camera`, because OpenCV's own choice differs between
    versions. Without it, it is the camera that keeps no invalid pixels. Ground truth is converted
    from the body (IMU) to the rectified left camera.

    reader_options: time_unit (ns).
    """

    known_options = ("time_unit",)
    sensors = ("stereo", "mono")
    takes_distortion = False

    def __init__(self, path: Path, options: ReaderOptions) -> None:
        super().__init__(path, options)
        self._mav = path / "mav0" if (path / "mav0").is_dir() else path
        self._names = ("cam0",) if options.sensor == "mono" else ("cam0", "cam1")
        left, *right = (self._image_list(self._mav / name) for name in self._names)
        self._frames: list[tuple[_Image, ...]] = [(image,) for image in left]
        if right:
            times = [[image.time_ns for image in images] for images in (left, right[0])]
            pairs = pairs_of_sensors(times[0], times[1], 1e-3)
            self._frames = [(left[i], right[0][j]) for i, j in pairs]
            self._note_unpaired(len(left), len(pairs))
        if not self._frames:
            raise SlambedError(
                f"{self._mav}: cam0 and cam1 have no time in common within 1 ms; re-time one of "
                "them, or take 'sensor: mono'"
            )
        self._sensors = [read_asl(self._sensor_file(name)) for name in self._names]
        if len({sensor.size for sensor in self._sensors}) > 1:
            raise SlambedError(f"{self._mav}: cam0 and cam1 have different resolutions")
        self._size = self._sensors[0].size
        self._straighten()

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, i: int) -> Frame:
        planes = [self._remap(image.file, side) for side, image in enumerate(self._frames[i])]
        return Frame(self._frames[i][0].time_ns, planes[0], planes[1] if len(planes) > 1 else None)

    def times_ns(self) -> list[int]:
        return [images[0].time_ns for images in self._frames]

    def place(self, i: int) -> str:
        return f"{self._mav / 'cam0' / 'data.csv'}:{self._frames[i][0].line}"

    def files(self) -> Iterable[Path]:
        for name in self._names:
            yield self._sensor_file(name)
            yield self._mav / name / "data.csv"
        if (poses := self._poses_file()) is not None:
            yield poses
        for images in self._frames:
            yield from (image.file for image in images)

    def size(self) -> tuple[int, int]:
        return self._size

    def camera(self) -> Camera:
        p0 = self._projections[0]
        bf = -self._projections[1][0, 3] if len(self._projections) > 1 else 0.0
        numbers = [float(v) for v in (p0[0, 0], p0[1, 1], p0[0, 2], p0[1, 2], bf)]
        if not (min(numbers[:2]) > 0 and bf >= 0 and np.isfinite(numbers).all()):
            raise SlambedError(
                f"{self._mav}: the sensor.yaml of its cameras rectify to fx {numbers[0]:g}, fy "
                f"{numbers[1]:g}, bf {bf:g}, expected above 0; correct intrinsics and T_BS"
            )
        return Camera(fx=p0[0, 0], fy=p0[1, 1], cx=p0[0, 2], cy=p0[1, 2], bf=bf)

    def trajectory(self) -> Trajectory | None:
        file = self._poses_file()
        if file is None:
            return None
        if not self.options.groundtruth and file.parent.name == "mocap0":
            self.notes.append(f"{file}: taken as ground truth of the body (IMU)")
        named = named_columns(read_lines(file), str(file)) or _COLUMNS
        table = pose_rows(file, named.count, _POSE, longer=True)
        rows = np.array([[v[place] for place in named.order] for _, v in table]).reshape(-1, 8)
        check_quaternions(rows[:, 4:8], [f"{file}:{line}" for line, _ in table])
        x, y, z, w = rows[:, 4:8].T
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
        pose = self._sensors[0].pose
        assert pose is not None
        unit = named.unit if named.unit in NS_PER else None
        if unit is None or named is _COLUMNS:
            counts = [Decimal(repr(float(stamp))) for stamp in rows[:, 0]]
            unit = recognized_unit(counts, "ns", _POSES_PER_S) or "ns"
            if unit != "ns":
                raise SlambedError(
                    f"{file}: times in {UNIT_NAMES[unit]}, where EuRoC has nanoseconds; is it in "
                    "TUM's order, qw last? Add a first line that names the columns: '#timestamp "
                    "[s], x, y, z, qx, qy, qz, qw'"
                )
        stamps_s = rows[:, 0] * (NS_PER[unit] / NS_PER["s"])
        found = Trajectory.of_matrices(stamps_s, world_body @ (pose @ raw_rectified))
        return found.take(np.argsort(found.stamps_s, kind="stable"))

    def _straighten(self) -> None:
        """Computes rotations, projections and remapping tables of the cameras."""
        if len(self._sensors) == 1:
            self._rotations = [np.eye(3)]
            self._projections = [np.column_stack([self._sensors[0].lens.matrix, np.zeros(3)])]
        else:
            r0, r1, p0, p1 = self._rectify(*self._sensors)
            self._rotations, self._projections = [r0, r1], [p0, p1]
        if (camera := self.options.camera) is not None:
            p0 = np.array(
                [[camera.fx, 0, camera.cx, 0], [0, camera.fy, camera.cy, 0], [0, 0, 1.0, 0]]
            )
            projections = [p0]
            for old in self._projections[1:]:
                projections.append(p0.copy())
                projections[1][0, 3] = camera.fx * (old[0, 3] / old[0, 0])
            self._projections = projections
        self._maps = [
            sensor.lens.maps(rotation, projection, self._size)
            for sensor, rotation, projection in zip(
                self._sensors, self._rotations, self._projections, strict=True
            )
        ]

    def _rectify(
        self, left: CalibratedCamera, right: CalibratedCamera
    ) -> tuple[NDArray[np.float64], ...]:
        assert left.pose is not None and right.pose is not None
        right_left = np.linalg.inv(right.pose) @ left.pose
        x, y, z = np.linalg.inv(right_left)[:3, 3]  # right camera in the left camera's frame
        if not x > max(abs(y), abs(z)):
            raise SlambedError(
                f"{self._mav}: cam1 is {1e3 * x:.4g} mm to the right of cam0, {1e3 * y:.4g} mm "
                f"below and {1e3 * z:.4g} mm in front of it (T_BS of both sensor.yaml); a rig side "
                "by side is expected, cam0 on the left; correct T_BS, swap the cameras, or take "
                "'sensor: mono'"
            )
        return rectified(
            left.lens, right.lens, self._size, right_left[:3, :3].copy(), right_left[:3, 3:].copy()
        )

    def _remap(self, file: Path, side: int) -> GrayImage:
        image = read_gray(file, self._size, self.gray_range)
        map_x, map_y = self._maps[side]
        warped = cv2.remap(image, map_x, map_y, interpolation=cv2.INTER_LINEAR)
        return np.asarray(warped, dtype=np.uint8)

    def _sensor_file(self, name: str) -> Path:
        return require(self._mav / name / "sensor.yaml", "calibration")

    def _poses_file(self) -> Path | None:
        if asked := self.options.groundtruth:
            beside = self.path / asked
            return beside if is_file(beside) else require_poses(self._mav / asked)
        return next((self._mav / name for name in _POSES if is_file(self._mav / name)), None)

    def _image_list(self, folder: Path) -> list[_Image]:
        """Reads lines `time, file`; a missing file name is derived from the time."""
        listing = require(folder / "data.csv", "list of images")
        rows = []
        for number, line in table_lines(listing):
            time, _, name = _SEPARATOR.sub(",", line.strip(), count=1).partition(",")
            rows.append((number, time, name.rstrip(" ,;") or f"{time}.png"))
        times_ns = self._in_ns(listing, [(number, time) for number, time, _ in rows], "ns")
        images = [
            _Image(time_ns, folder / "data" / name, number)
            for time_ns, (number, _, name) in zip(times_ns, rows, strict=True)
        ]
        if not images:
            raise SlambedError(f"{listing}: no image in it; expected lines 'time, file'")
        return sorted(images, key=lambda image: image.time_ns)
