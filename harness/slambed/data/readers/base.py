# SPDX-License-Identifier: Apache-2.0
"""What every dataset reader offers."""

from __future__ import annotations

import math
import re
import sys
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
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

_NUMBER = re.compile(r"(?:frame-)?(\d{1,18})")


@dataclass(frozen=True)
class ReaderOptions:
    """What a dataset file says about the sequence; `extra` is its reader_options mapping."""

    sensor: Sensor
    size: tuple[int, int] | None = None  #: width, height; None: the reader finds out
    camera: Camera | None = None  #: None: the reader takes it from the dataset's own files
    distortion: tuple[float, ...] = ()  #: that the dataset file gives its camera
    depth_unit_m: float = 0.0
    fps: float = 30.0
    groundtruth: str | None = None  #: file in the source folder
    further_parts: tuple[Path, ...] = ()  #: of a recording in several files, all but the first
    extra: dict[str, Any] = field(default_factory=dict)


class SequenceReader(ABC):
    """A recorded sequence: length, frames in order of time, ground truth.

    Readers whose frames are files of their own are FolderReaders: those are decoded on all cores.
    """

    #: Names allowed in reader_options, and beside them those that all readers know.
    known_options: tuple[str, ...] = ()
    common_options = ("gray_range", "max_gap_s")
    #: What the format can hold.
    sensors: tuple[Sensor, ...] = ("rgbd", "stereo", "mono")
    #: False where the format's own calibration says how the lens distorts.
    takes_distortion = True
    #: True where what a pattern of `paths` finds in several files is one recording.
    reads_parts = False
    #: Where poses come from in a format without `groundtruth:`; empty where that names their file.
    truth_without_key = ""

    def __init__(self, path: Path, options: ReaderOptions) -> None:
        self.path = path
        self.options = options
        #: What whoever prepares the sequence should know: what was left out or recognized.
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
        """A number above 0 of reader_options."""
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
        """How far the times of two sensors may be apart."""
        return self._positive_option("max_difference_s", MAX_DIFFERENCE_S) or MAX_DIFFERENCE_S

    def _note_unpaired(self, first: int, paired: int) -> None:
        """What has no partner is not played; a benchmark's recordings have some at their ends."""
        if paired < first:
            self.notes.append(
                f"{self.path}: {first - paired} of {first} pictures have none of the second sensor "
                "near them and are left out"
            )

    def _in_ns(self, file: Path, stamps: list[tuple[int, str]], usual: str) -> list[int]:
        """Nanoseconds of a file's times, given with their lines; `usual` is the format's unit."""
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
        """Recorded time of every frame, in order."""

    def place(self, i: int) -> str:
        """Where the time of frame i is written."""
        return f"{self.path}"

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def __iter__(self) -> Iterator[Frame]: ...

    @abstractmethod
    def files(self) -> Iterable[Path]:
        """Every file the content depends on; preparation is repeated when one changes."""

    def trajectory(self) -> Trajectory | None:
        """Ground truth: left (or color) camera to world, recorded time."""
        return None

    def camera(self) -> Camera:
        """The camera of the frames as delivered."""
        if self.options.camera is None:
            raise SlambedError(f"{self.path}: this reader needs 'camera' in the dataset file")
        if self.options.camera.bf == 0 and self.options.sensor != "mono":
            raise SlambedError(
                f"{self.path}: bf of the dataset's camera is 0, so nothing would be near; expected "
                "fx times the baseline, of depth a virtual one (40 at 640x480)"
            )
        return self.options.camera

    def size(self) -> tuple[int, int]:
        """Width and height of the frames as delivered."""
        if self.options.size is None:
            raise SlambedError(f"{self.path}: this reader needs the camera's width and height")
        return self.options.size


class FolderReader(SequenceReader):
    """A reader whose frames can be fetched in any order."""

    @abstractmethod
    def __getitem__(self, i: int) -> Frame: ...

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))


def numbered(folder: Path, pattern: str) -> list[Path]:
    """Files in the order of their numbers, `frame-9` before `frame-10`; by name without any."""
    files = sorted(folder.glob(pattern))
    if any(number_of(file) is None for file in files):
        return files
    return sorted(files, key=lambda file: number_of(file) or 0)


def number_of(file: Path) -> int | None:
    """The number that a file is named by, as in frame-000012.color.png and 000012.png."""
    digits = _NUMBER.fullmatch(file.name.partition(".")[0])
    return int(digits[1]) if digits else None


def first_missing(files: list[Path]) -> tuple[int, int]:
    """How many numbers are not there between the first and the last of numbered files, and the
    first of them."""
    numbers = [number_of(file) or 0 for file in files]
    gaps = [(b - a - 1, a + 1) for a, b in pairwise(numbers) if b > a + 1]
    return sum(count for count, _ in gaps), gaps[0][1] if gaps else 0


def require(path: Path, what: str) -> Path:
    """The path itself when it exists, else one clear line."""
    if not path.exists():
        raise SlambedError(f"{path} is missing ({what}); complete the dataset")
    return path


def require_poses(path: Path) -> Path:
    """The file that `groundtruth:` names: who asked for it is not left without."""
    if not is_file(path):
        raise SlambedError(
            f"{path} is missing (ground truth); complete the dataset, or remove 'groundtruth' "
            "from its file to go without"
        )
    return path


def _is_number(value: object) -> bool:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) <= sys.float_info.max
