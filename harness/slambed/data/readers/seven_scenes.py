# SPDX-License-Identifier: Apache-2.0
"""7-Scenes (Microsoft Research): frame-000000.color.png (or .jpg), .depth.png, .pose.txt in
seq-XX."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slambed.data.images import read_depth, read_gray
from slambed.data.model import Frame
from slambed.data.readers.base import (
    PICTURES,
    FolderReader,
    ReaderOptions,
    first_missing,
    number_of,
    numbered,
)
from slambed.data.rotations import check_pose
from slambed.data.stamps import LARGEST_NS
from slambed.data.text_file import fields, read_lines
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError

#: 7-Scenes' value for missing depth.
_INVALID_DEPTH = 65535


class Reader(FolderReader):
    """Frames have no recorded time: frame i gets (its number - the first number) / fps. Poses are
    camera to world; a frame without tracking (ScanNet writes -inf) has none.

    reader_options: sequence ("seq-01", a folder below the path; default: the path itself).
    """

    known_options = ("sequence",)
    sensors = ("rgbd", "mono")
    truth_without_key = "poses come from frame-*.pose.txt; remove the key"

    def __init__(self, path: Path, options: ReaderOptions) -> None:
        super().__init__(path, options)
        folder = path / str(options.extra["sequence"]) if "sequence" in options.extra else path
        self._color = numbered(folder, "frame-", [f".color{suffix}" for suffix in PICTURES])
        if not self._color:
            raise SlambedError(
                f"{folder}: no frame-*.color.png or .color.jpg in it; unpack the sequence there"
            )
        numbers = [number_of(file) for file in self._color]
        if None in numbers:
            raise SlambedError(f"{folder}: expected frame-NUMBER.color.png; rename the images")
        missing, first = first_missing(self._color)
        if missing:
            self.notes.append(
                f"{folder}: {missing} images are missing, the first is number {first}; "
                "times go by number"
            )
        self._numbers = [(n or 0) - (numbers[0] or 0) for n in numbers]
        if self._numbers[-1] / options.fps * 1e9 > LARGEST_NS:
            raise SlambedError(
                f"{folder}: at {options.fps:g} frames a second the last image would be "
                f"{self._numbers[-1] / options.fps:.3g} s later; correct fps of the dataset file"
            )

    def __len__(self) -> int:
        return len(self._color)

    def __getitem__(self, i: int) -> Frame:
        size = self.options.size
        gray = read_gray(self._color[i], size, self.gray_range)
        if self.options.sensor == "mono":
            return Frame(self._time_ns(i), gray, None)
        depth = read_depth(self._sibling(i, "depth.png"), size).copy()
        depth[depth == _INVALID_DEPTH] = 0
        return Frame(self._time_ns(i), gray, depth)

    def times_ns(self) -> list[int]:
        return [self._time_ns(i) for i in range(len(self))]

    def place(self, i: int) -> str:
        return str(self._color[i])

    def files(self) -> Iterable[Path]:
        for i, color in enumerate(self._color):
            yield color
            if self.options.sensor == "rgbd":
                yield self._sibling(i, "depth.png")
            yield self._sibling(i, "pose.txt")

    def trajectory(self) -> Trajectory | None:
        poses = [_read_pose(self._sibling(i, "pose.txt")) for i in range(len(self))]
        known = [i for i, pose in enumerate(poses) if np.isfinite(pose).all()]
        if len(known) < len(poses):
            first = next(i for i in range(len(poses)) if i not in known)
            self.notes.append(
                f"{self._sibling(first, 'pose.txt')}: not finite, tracking was lost: "
                f"{len(poses) - len(known)} of {len(poses)} frames are without a pose"
            )
        for i in known:
            check_pose(poses[i], str(self._sibling(i, "pose.txt")))
        if not known:
            return None
        times_s = np.array([self._time_ns(i) for i in known], dtype=np.float64) * 1e-9
        return Trajectory.of_matrices(times_s, np.array([poses[i] for i in known]))

    def _time_ns(self, i: int) -> int:
        return round(self._numbers[i] * 1e9 / self.options.fps)

    def _sibling(self, i: int, suffix: str) -> Path:
        color = self._color[i]
        return color.with_name(f"{color.name.rsplit('.', 2)[0]}.{suffix}")


def _read_pose(file: Path) -> NDArray[np.float64]:
    try:
        values = [float(word) for line in read_lines(file) for word in fields(line)]
    except ValueError:
        values = []
    if len(values) != 16 or any(math.isnan(v) for v in values[12:]):
        raise SlambedError(f"{file}: not a 4x4 pose, expected 16 numbers; fetch the file again")
    return np.array(values).reshape(4, 4)
