# SPDX-License-Identifier: Apache-2.0
"""TUM RGB-D benchmark folders: rgb.txt, images, groundtruth.txt, and depth.txt but for mono."""

from __future__ import annotations

from collections.abc import Iterable
from decimal import InvalidOperation
from pathlib import Path

from slambed.data.association import MAX_DIFFERENCE_S, pairs_of_sensors
from slambed.data.images import read_depth, read_grey
from slambed.data.model import Frame
from slambed.data.readers.base import FolderReader, ReaderOptions, require, seconds_to_ns
from slambed.data.trajectory import Trajectory, read_groundtruth
from slambed.errors import SlambedError


class Reader(FolderReader):
    """Colour and depth paired by time, closest first, one-to-one; the frame has the colour's time.
    With `sensor: mono` every colour image, and no depth is asked for.

    reader_options: max_difference_s (0.02).
    """

    known_options = ("max_difference_s",)

    def __init__(self, path: Path, options: ReaderOptions) -> None:
        super().__init__(path, options)
        kinds = ("rgb",) if options.sensor == "mono" else ("rgb", "depth")
        self._lists = [require(path / f"{kind}.txt", "list of images") for kind in kinds]
        self._frames: list[tuple[int, Path, Path | None]]
        if options.sensor == "mono":
            self._frames = [(t, file, None) for t, file in read_file_list(self._lists[0])]
            return
        colour, depth = (read_file_list(file) for file in self._lists)
        limit_s = float(options.extra.get("max_difference_s", MAX_DIFFERENCE_S))
        pairs = pairs_of_sensors([t for t, _ in colour], [t for t, _ in depth], limit_s)
        if not pairs:
            raise SlambedError(
                f"{path}: no colour image has a depth image within {limit_s} s; "
                "check the times in rgb.txt and depth.txt"
            )
        self._frames = [(colour[i][0], colour[i][1], depth[j][1]) for i, j in pairs]

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, i: int) -> Frame:
        time_ns, colour, depth = self._frames[i]
        size = self.options.size
        second = None if depth is None else read_depth(depth, size)
        return Frame(time_ns, read_grey(colour, size), second)

    def files(self) -> Iterable[Path]:
        yield from self._lists
        if self.options.groundtruth:
            yield self.path / self.options.groundtruth
        for _, colour, depth in self._frames:
            yield colour
            if depth is not None:
                yield depth

    def trajectory(self) -> Trajectory | None:
        if not self.options.groundtruth:
            return None
        return read_groundtruth(require(self.path / self.options.groundtruth, "ground truth"))


def read_file_list(path: Path) -> list[tuple[int, Path]]:
    """Lines `time file`; '#' comments. Sorted by time, repeated times dropped."""
    entries: dict[int, Path] = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        content = line.split("#", 1)[0].split()
        if not content:
            continue
        try:
            time_ns = seconds_to_ns(content[0])
            entries.setdefault(time_ns, path.parent / content[1])
        except (InvalidOperation, ValueError, OverflowError, IndexError) as broken:
            raise SlambedError(f"{path}:{number}: expected 'time file', got '{line}'") from broken
    return sorted(entries.items())
