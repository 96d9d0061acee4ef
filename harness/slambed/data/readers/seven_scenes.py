# SPDX-License-Identifier: Apache-2.0
"""7-Scenes (Microsoft Research): frame-000000.color.png, .depth.png, .pose.txt in seq-XX."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from slambed.data.images import read_depth, read_grey
from slambed.data.model import Frame
from slambed.data.readers.base import FolderReader, ReaderOptions
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError

#: What 7-Scenes writes for "no measurement".
_INVALID_DEPTH = 65535


class Reader(FolderReader):
    """Frames have no recorded time: frame i gets i / fps. Poses are camera to world.

    reader_options: sequence ("seq-01", a folder below the path; without it the path itself).
    """

    known_options = ("sequence",)

    def __init__(self, path: Path, options: ReaderOptions) -> None:
        super().__init__(path, options)
        folder = path / str(options.extra["sequence"]) if "sequence" in options.extra else path
        self._colour = sorted(folder.glob("frame-*.color.png"))
        if not self._colour:
            raise SlambedError(f"{folder}: no frame-*.color.png in it; unpack the sequence there")

    def __len__(self) -> int:
        return len(self._colour)

    def __getitem__(self, i: int) -> Frame:
        size = self.options.size
        depth = read_depth(self._sibling(i, "depth.png"), size).copy()
        depth[depth == _INVALID_DEPTH] = 0
        return Frame(round(i * 1e9 / self.options.fps), read_grey(self._colour[i], size), depth)

    def files(self) -> Iterable[Path]:
        for i, colour in enumerate(self._colour):
            yield colour
            yield self._sibling(i, "depth.png")
            yield self._sibling(i, "pose.txt")

    def trajectory(self) -> Trajectory | None:
        matrices = []
        for i in range(len(self)):
            file = self._sibling(i, "pose.txt")
            try:
                matrices.append(np.loadtxt(file, dtype=np.float64).reshape(4, 4))
            except (OSError, ValueError) as broken:
                raise SlambedError(f"{file}: not a 4x4 pose; fetch the file again") from broken
        times_s = np.round(np.arange(len(self)) * 1e9 / self.options.fps) * 1e-9
        return Trajectory.of_matrices(times_s, np.array(matrices))

    def _sibling(self, i: int, suffix: str) -> Path:
        colour = self._colour[i]
        return colour.with_name(colour.name.removesuffix("color.png") + suffix)
