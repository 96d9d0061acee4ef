# SPDX-License-Identifier: Apache-2.0
"""What every dataset reader offers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

from slambed.data.model import Camera, Frame, Sensor
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError
from slambed.suggestion import did_you_mean


@dataclass(frozen=True)
class ReaderOptions:
    """What a dataset file says about the sequence; `extra` is its reader_options mapping."""

    sensor: Sensor
    size: tuple[int, int] | None = None  #: width, height; None: the reader finds out
    camera: Camera | None = None  #: None: the reader takes it from the dataset's own files
    depth_unit_m: float = 0.0
    fps: float = 30.0
    groundtruth: str | None = None  #: file in the source folder
    extra: dict[str, Any] = field(default_factory=dict)


class SequenceReader(ABC):
    """A recorded sequence: length, frames in order of time, ground truth.

    Readers whose frames are files of their own are FolderReaders: those are decoded on all cores.
    """

    #: Names allowed in reader_options.
    known_options: tuple[str, ...] = ()

    def __init__(self, path: Path, options: ReaderOptions) -> None:
        self.path = path
        self.options = options
        for name in options.extra:
            if name not in self.known_options:
                raise SlambedError(
                    f"reader_options: unknown key '{name}'"
                    f"{did_you_mean(name, self.known_options)}; known: "
                    f"{', '.join(self.known_options) or 'none'}"
                )

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def __iter__(self) -> Iterator[Frame]: ...

    @abstractmethod
    def files(self) -> Iterable[Path]:
        """Every file the content depends on; preparation is repeated when one changes."""

    def trajectory(self) -> Trajectory | None:
        """Ground truth: left (or colour) camera to world, recorded time."""
        return None

    def camera(self) -> Camera:
        """The camera of the frames as delivered."""
        if self.options.camera is None:
            raise SlambedError(f"{self.path}: this reader needs 'camera' in the dataset file")
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


def seconds_to_ns(text: str) -> int:
    """Exact nanoseconds of a decimal number of seconds."""
    return int((Decimal(text) * 1_000_000_000).to_integral_value())


def require(path: Path, what: str) -> Path:
    """The path itself when it exists, else one clear line."""
    if not path.exists():
        raise SlambedError(f"{path} is missing ({what}); complete the dataset")
    return path
