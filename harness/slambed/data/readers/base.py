# SPDX-License-Identifier: Apache-2.0
"""The interface of dataset readers."""

from __future__ import annotations

import math
import re
import sys
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from slambed.data.association import MAX_DIFFERENCE_S
from slambed.data.model import Camera, Frame, Sensor
from slambed.data.stamps import (
    NS_PER,
    UNIT_NAMES,
    number_or_date,
    recognized_unit,
    to_ns,
    unit_question,
)
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError
from slambed.files.outputs import is_file
from slambed.suggestion import did_you_mean

PICTURES = (".png", ".jpg", ".jpeg")
"""Endings of gray and color pictures, in any case."""
_NUMBER = re.compile(r"([^\W\d]*[-_ ]?)(\d{1,18})")


@dataclass(frozen=True)
class ReaderOptions:
    """The settings of a dataset file; `extra` is its reader_options mapping."""

    sensor: Sensor
    size: tuple[int, int] | None = None  #: width, height; None: the reader determines it
    camera: Camera | None = None  #: None: taken from the dataset's own files
    distortion: tuple[float, ...] = ()  #: distortion of the camera in the dataset file
    depth_unit_m: float = 0.0
    fps: float = 30.0
    groundtruth: str | None = None  #: file in the source folder
    further_parts: tuple[Path, ...] = ()  #: of a multi-file recording, without the first
    extra: dict[str, Any] = field(default_factory=dict)


class SequenceReader(ABC):
    """A recorded sequence: length, frames sorted by time, ground truth.

    Readers whose frames are separate files are FolderReaders, which are decoded on all cores.
    """

    #: Names allowed in reader_options, in addition to the common ones of all readers.
    known_options: tuple[str, ...] = ()
    common_options = ("gray_range", "max_gap_s")
    #: Sensors that the format supports.
    sensors: tuple[Sensor, ...] = ("rgbd", "stereo", "mono")
    #: False if the format's own calibration includes the distortion.
    takes_distortion = True
    #: True if several files that match a pattern of `paths` are one recording.
    reads_parts = False
    #: Hint for formats without `groundtruth:` on where poses come from; empty if the key is used.
    truth_without_key = ""

    def __init__(self, path: Path, options: ReaderOptions) -> None:
        self.path = path
        self.options = options
        #: Remarks for the user: what was skipped or detected.
        self.notes: list[str] = []
        if options.further_parts and not self.reads_parts:
            self.notes.append(
                f"{path}: 'paths' matches {len(options.further_parts)} more, as "
                f"{options.further_parts[0]}; only the first is read"
            )
        known = (*self.known_options, *self.common_options)
        for name in options.extra:
            if name not in known:
                raise SlambedError(
                    f"{path}: reader_options: unknown key '{name}'{did_you_mean(name, known)}; "
                    f"known: {', '.join(known)}"
                )
        if options.sensor not in self.sensors:
            raise SlambedError(
                f"{path}: this format holds {' or '.join(self.sensors)}, not {options.sensor}; "
                "correct sensor or reader of the dataset file"
            )
        if any(options.distortion) and not self.takes_distortion:
            raise SlambedError(
                f"{path}: 'distortion' of the dataset's camera is not used by this reader, the "
                "format's own calibration counts; remove it"
            )
        if options.groundtruth and self.truth_without_key:
            raise SlambedError(
                f"{path}: 'groundtruth: {options.groundtruth}' is not used by this reader; "
                f"{self.truth_without_key}"
            )
        self.max_gap_s = self._positive_option("max_gap_s", None)
        self.gray_range = self._gray_range()

    def _positive_option(self, name: str, default: float | None) -> float | None:
        """Returns a number above 0 of reader_options."""
        value = self.options.extra.get(name, default)
        if value is None or (_is_number(value) and value > 0):
            return value
        raise SlambedError(
            f"{self.path}: reader_options: {name} must be a number above 0, not {value!r}"
        )

    def _gray_range(self) -> tuple[float, float] | None:
        asked = self.options.extra.get("gray_range")
        if asked is None:
            return None
        if isinstance(asked, list) and len(asked) == 2 and all(map(_is_number, asked)):
            low, high = (float(value) for value in asked)
            if low < high and math.isfinite(255 / (high - low)):
                return low, high
        raise SlambedError(
            f"{self.path}: reader_options: gray_range must be two numbers, the lower one first, "
            f"not {asked!r}"
        )

    @property
    def max_difference_s(self) -> float:
        """Maximum time difference between the two sensors."""
        return self._positive_option("max_difference_s", MAX_DIFFERENCE_S) or MAX_DIFFERENCE_S

    def _note_unpaired(self, first: int, paired: int) -> None:
        """Reports frames without a partner, which are skipped; benchmark recordings have some at
        their ends."""
        if paired < first:
            self.notes.append(
                f"{self.path}: {first - paired} of {first} pictures have none of the second sensor "
                "near them and are left out"
            )

    def _in_ns(self, file: Path, stamps: list[tuple[int, str]], usual: str) -> list[int]:
        """Converts times of a file, given with line numbers, to nanoseconds; `usual` is the
        format's default unit."""
        counts = []
        for line, text in stamps:
            try:
                counts.append(number_or_date(text))
            except ValueError:
                raise SlambedError(
                    f"{file}:{line}: '{text}' is not a time, expected {UNIT_NAMES[usual]}; "
                    "correct or remove the line"
                ) from None
        asked = self.options.extra.get("time_unit")
        if asked is not None and asked not in tuple(NS_PER):
            raise SlambedError(
                f"{file}: reader_options: time_unit must be s, ms, us or ns, not {asked!r}"
            )
        unit = asked or recognized_unit(counts, usual, self.options.fps)
        if unit is None:
            raise unit_question(counts, usual, self.options.fps, str(file))
        if unit != usual and asked is None:
            self.notes.append(f"{file}: times are read as {UNIT_NAMES[unit]}")
        try:
            return [to_ns(count, unit) for count in counts]
        except ValueError as refused:
            raise SlambedError(f"{file}: {refused}; correct the times") from None

    @abstractmethod
    def times_ns(self) -> list[int]:
        """Returns the recorded time of every frame, in order."""

    def place(self, i: int) -> str:
        """Returns where the time of frame i is written."""
        return f"{self.path}"

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def __iter__(self) -> Iterator[Frame]: ...

    @abstractmethod
    def files(self) -> Iterable[Path]:
        """Yields all files that the content depends on; a change of one repeats the preparation."""

    def trajectory(self) -> Trajectory | None:
        """Returns the ground truth: left (or color) camera to world, in recorded time."""
        return None

    def camera(self) -> Camera:
        """Returns the camera of the delivered frames."""
        if self.options.camera is None:
            raise SlambedError(f"{self.path}: this reader needs 'camera' in the dataset file")
        if self.options.camera.bf == 0 and self.options.sensor != "mono":
            raise SlambedError(
                f"{self.path}: bf of the dataset's camera is 0, so nothing would be near; expected "
                "fx times the baseline, of depth a virtual one (40 at 640x480)"
            )
        return self.options.camera

    def size(self) -> tuple[int, int]:
        """Returns width and height of the delivered frames."""
        if self.options.size is None:
            raise SlambedError(f"{self.path}: this reader needs the camera's width and height")
        return self.options.size


class FolderReader(SequenceReader):
    """A reader with random access to frames."""

    @abstractmethod
    def __getitem__(self, i: int) -> Frame: ...

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))


def numbered(folder: Path, head: str, tails: Sequence[str]) -> list[Path]:
    """Returns the files whose names begin with `head` and end with one of `tails`, in any case,
    sorted by number, `frame-9` before `frame-10`; by name if a file has none. Hidden files, as the
    `._000000.png` of macOS, are none of them.

    Raises SlambedError for files with different names before their numbers, and for pictures that
    are there in two formats.
    """
    files = [
        file
        for file in sorted(folder.glob(f"{head}*"))
        if not file.name.startswith(".") and file.name.lower().endswith(tuple(tails))
    ]
    if len(suffixes := sorted({file.suffix.lower() for file in files})) > 1:
        raise SlambedError(
            f"{folder}: pictures in several formats ({', '.join(suffixes)}); leave those of one"
        )
    named = {name[1]: file for file in files if (name := _numbered_name(file)) is not None}
    if any(number_of(file) is None for file in files):
        return files
    if len(named) > 1:
        one, other = list(named.values())[:2]
        raise SlambedError(
            f"{folder}: images of several names, as {one.name} and {other.name}; give each camera "
            "a folder of its own"
        )
    return sorted(files, key=lambda file: number_of(file) or 0)


def number_of(file: Path) -> int | None:
    """Returns the number in a file name such as frame-000012.color.png, img_12.png or
    000012.png."""
    found = _numbered_name(file)
    return int(found[2]) if found else None


def _numbered_name(file: Path) -> re.Match[str] | None:
    return _NUMBER.fullmatch(file.name.partition(".")[0])


def first_missing(files: list[Path]) -> tuple[int, int]:
    """Returns how many numbers are missing between the first and the last file, and the first
    missing one."""
    numbers = [number_of(file) or 0 for file in files]
    gaps = [(b - a - 1, a + 1) for a, b in pairwise(numbers) if b > a + 1]
    return sum(count for count, _ in gaps), gaps[0][1] if gaps else 0


def require(path: Path, what: str) -> Path:
    """Returns the path; raises a one-line SlambedError if it does not exist."""
    if not path.exists():
        raise SlambedError(f"{path} is missing ({what}); complete the dataset")
    return path


def require_poses(path: Path) -> Path:
    """Returns the file named by `groundtruth:`; raises SlambedError if it is missing."""
    if not is_file(path):
        found = "a folder" if path.is_dir() else "missing"
        raise SlambedError(
            f"{path} is {found} (ground truth); complete the dataset, or remove 'groundtruth' from "
            "its file to go without"
        )
    return path


def _is_number(value: object) -> bool:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) <= sys.float_info.max
