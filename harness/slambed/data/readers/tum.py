# SPDX-License-Identifier: Apache-2.0
"""TUM RGB-D benchmark folders: rgb.txt, images, groundtruth.txt, and depth.txt except for mono."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from slambed.data.association import pairs_of_sensors
from slambed.data.images import read_depth, read_gray
from slambed.data.model import Frame
from slambed.data.readers.base import FolderReader, ReaderOptions, require, require_poses
from slambed.data.text_file import table_lines
from slambed.data.trajectory import Trajectory, as_groundtruth, read_tum, repeated_times
from slambed.errors import SlambedError
from slambed.files.outputs import is_file

_ENTRY = re.compile(r"\s*([^\s,;]+)[\s,;]+(.*?)[\s,;]*")
_COMMENT = re.compile(r"[\s,;]+#.*")


@dataclass(frozen=True)
class _Image:
    """A line of rgb.txt or depth.txt."""

    time_ns: int
    file: Path
    line: int


class Reader(FolderReader):
    """Color and depth are paired by time, closest first, one-to-one; a frame has the time of its
    color image.

    With `sensor: mono` all color images are used, without depth.

    reader_options: max_difference_s (0.02), time_unit (s).
    """

    known_options = ("max_difference_s", "time_unit")
    sensors = ("rgbd", "mono")

    def __init__(self, path: Path, options: ReaderOptions) -> None:
        super().__init__(path, options)
        kinds = ("rgb",) if options.sensor == "mono" else ("rgb", "depth")
        self._lists = [require(path / f"{kind}.txt", "list of images") for kind in kinds]
        color, *depth = (self._read_list(file) for file in self._lists)
        self._frames: list[tuple[_Image, _Image | None]]
        if not depth:
            self._frames = [(image, None) for image in color]
            return
        times = [[image.time_ns for image in images] for images in (color, depth[0])]
        pairs = pairs_of_sensors(times[0], times[1], self.max_difference_s)
        if not pairs:
            raise SlambedError(
                f"{path}: no color image has a depth image within {self.max_difference_s} s; "
                "check the times in rgb.txt and depth.txt"
            )
        self._frames = [(color[i], depth[0][j]) for i, j in pairs]
        self._note_unpaired(len(color), len(pairs))

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, i: int) -> Frame:
        color, depth = self._frames[i]
        size = self.options.size
        second = None if depth is None else read_depth(depth.file, size)
        return Frame(color.time_ns, read_gray(color.file, size, self.gray_range), second)

    def times_ns(self) -> list[int]:
        return [color.time_ns for color, _ in self._frames]

    def place(self, i: int) -> str:
        return f"{self._lists[0]}:{self._frames[i][0].line}" if self._frames else str(self.path)

    def files(self) -> Iterable[Path]:
        yield from self._lists
        if self.options.groundtruth:
            yield require_poses(self.path / self.options.groundtruth)
        for pair in self._frames:
            for listing, image in zip(self._lists, pair, strict=False):
                if image is None:
                    continue
                if not is_file(image.file):
                    raise SlambedError(
                        f"{image.file}: no such file, which {listing.name} line {image.line} "
                        "names; complete the dataset"
                    )
                yield image.file

    def trajectory(self) -> Trajectory | None:
        if not self.options.groundtruth:
            return None
        file = require_poses(self.path / self.options.groundtruth)
        found = read_tum(file)
        if again := repeated_times(found):
            self.notes.append(
                f"{file}: poses that differ from another one of the same time: {again}; the first "
                "of each time is taken"
            )
        return as_groundtruth(found, file)

    def _read_list(self, path: Path) -> list[_Image]:
        """Reads lines `time file`, sorted by time; of lines with the same time the first is
        kept."""
        lines, stamps, names = [], [], []
        for number, line in table_lines(path):
            entry = _ENTRY.fullmatch(line)
            if entry is None or not entry[2]:
                raise SlambedError(
                    f"{path}:{number}: expected 'time file', got '{line[:80]}'; correct or remove "
                    "the line"
                )
            lines.append(number)
            stamps.append((number, entry[1]))
            names.append(entry[2])
        if not lines:
            raise SlambedError(f"{path}: no image in it; expected lines 'time file'")
        times_ns = self._in_ns(path, stamps, "s")
        self._note_order(path, lines, times_ns)
        images: dict[int, _Image] = {}
        for number, time_ns, name in zip(lines, times_ns, names, strict=True):
            file = _named_file(path, number, name)
            images.setdefault(time_ns, _Image(time_ns, file, number))
        if len(images) == 1 < len(lines):
            raise SlambedError(
                f"{path}: all {len(lines)} lines have the time {stamps[0][1]}; record time stamps"
            )
        if len(images) < len(lines):
            self.notes.append(
                f"{path}: {len(lines) - len(images)} lines have the time of another one and are "
                "left out, but for the first"
            )
        return [images[time_ns] for time_ns in sorted(images)]

    def _note_order(self, path: Path, lines: list[int], times_ns: list[int]) -> None:
        later = zip(lines[1:], times_ns, times_ns[1:], strict=False)
        back = [(line, a - b) for line, a, b in later if b < a]
        if back:
            self.notes.append(
                f"{path}:{back[0][0]}: time goes back by {back[0][1] * 1e-9:.6f} s; images are "
                f"played in the order of their times ({len(back)} such lines)"
            )


def _named_file(listing: Path, line: int, rest: str) -> Path:
    """Returns the file that the rest of a line names. Its name may contain blanks and `#`, and
    further columns and a comment may follow it."""
    uncommented = _COMMENT.sub("", rest)
    names = list(dict.fromkeys([rest, uncommented, (uncommented or rest).split()[0]]))
    for name in names:
        if len(names) == 1 or is_file(listing.parent / name):
            return listing.parent / name
    raise SlambedError(
        f"{listing}:{line}: there is neither '{names[0]}' nor '{names[-1]}' in "
        f"{listing.parent}; a name with a blank? Complete the dataset"
    )
