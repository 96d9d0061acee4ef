# SPDX-License-Identifier: Apache-2.0
"""The prepared sequence (docs/reference/sequence.md): written once, then memory-mapped."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import zlib
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from slambed.data.model import Camera, Frame, GrayImage, SecondImage, Sensor
from slambed.data.trajectory import Trajectory, read_groundtruth, write_tum
from slambed.errors import SlambedError

SEQUENCE_FILE = "sequence.json"
FRAMES_FILE = "frames.bin"
INDEX_FILE = "index.bin"
GROUNDTRUTH_FILE = "groundtruth.txt"
BLOCK_ALIGNMENT_BYTES = 4096
INDEX_DTYPE = np.dtype([("timestamp_ns", "<i8"), ("crc32", "<u4"), ("flags", "<u4")])
FLAG_DUPLICATE = 1
_UNCHECKED_KEYS = ("checksum", "source")


class SequenceInfo(BaseModel):
    """The content of sequence.json."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal["slambed-sequence"] = "slambed-sequence"
    version: Literal[1] = 1
    id: str
    title: str
    sensor: Sensor
    width: int = Field(gt=0)
    height: int = Field(gt=0)
    frames: int = Field(gt=0)
    frame_stride_bytes: int = Field(gt=0, multiple_of=BLOCK_ALIGNMENT_BYTES)
    fps: float = Field(gt=0)
    camera: Camera
    depth_unit_m: float = Field(ge=0)
    close_depth_baselines: float = Field(gt=0)
    time_origin_s: float
    source: dict[str, Any] = Field(default_factory=dict)
    checksum: str


def block_bytes(sensor: Sensor, width: int, height: int) -> int:
    """Returns the bytes of one frame without padding."""
    return width * height * {"mono": 1, "stereo": 2, "rgbd": 3}[sensor]


def stride_bytes(sensor: Sensor, width: int, height: int) -> int:
    """Returns the bytes of one frame with padding."""
    return -(-block_bytes(sensor, width, height) // BLOCK_ALIGNMENT_BYTES) * BLOCK_ALIGNMENT_BYTES


def sequence_checksum(index: bytes, header: dict[str, Any]) -> str:
    """Returns SHA-256 over the index and the canonical header without `checksum` and `source`."""
    checked = {key: value for key, value in header.items() if key not in _UNCHECKED_KEYS}
    canonical = json.dumps(checked, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(index + canonical.encode()).hexdigest()


class PreparedSequence:
    """A memory-mapped prepared sequence. Indexing returns views without copying."""

    def __init__(self, path: Path, info: SequenceInfo, index: NDArray[np.void]) -> None:
        self.path = path
        self.info = info
        self.index = index
        self._frames = np.memmap(path / FRAMES_FILE, dtype=np.uint8, mode="r").reshape(
            info.frames, info.frame_stride_bytes
        )

    def __repr__(self) -> str:
        info = self.info
        what = f"{info.id!r}, sensor={info.sensor!r}, frames={info.frames}"
        return f"PreparedSequence({str(self.path)!r}, {what})"

    @classmethod
    def open(cls, path: Path | str) -> PreparedSequence:
        """Opens a folder; checks header, index and sizes, but not every frame."""
        path = Path(path)
        header_file = path / SEQUENCE_FILE
        try:
            header = json.loads(header_file.read_text(encoding="utf-8"))
            index_bytes = (path / INDEX_FILE).read_bytes()
            frames_bytes = (path / FRAMES_FILE).stat().st_size
            info = SequenceInfo.model_validate(header)
        except FileNotFoundError as missing:
            raise SlambedError(
                f"{path} is not a prepared sequence: {missing.filename} is missing; "
                "make it with 'slambed data prepare'"
            ) from missing
        except OSError as refused:
            raise _corrupt(Path(refused.filename or path), str(refused.strerror)) from refused
        except ValidationError as invalid:
            first = invalid.errors()[0]
            where = ".".join(str(part) for part in first["loc"])
            raise _corrupt(header_file, f"{where}: {first['msg'].lower()}") from invalid
        except (ValueError, RecursionError) as broken:
            raise _corrupt(header_file, f"not JSON ({broken})") from broken
        if len(index_bytes) != info.frames * INDEX_DTYPE.itemsize:
            raise _corrupt(path / INDEX_FILE, f"{len(index_bytes)} bytes, not {info.frames} x 16")
        if info.frame_stride_bytes < block_bytes(info.sensor, info.width, info.height):
            raise _corrupt(header_file, "frame_stride_bytes is smaller than a frame")
        if frames_bytes != info.frames * info.frame_stride_bytes:
            raise _corrupt(
                path / FRAMES_FILE,
                f"{frames_bytes} bytes, not {info.frames} x {info.frame_stride_bytes}",
            )
        if sequence_checksum(index_bytes, header) != info.checksum:
            raise _corrupt(path, "index or header does not fit its checksum")
        index = np.frombuffer(index_bytes, dtype=INDEX_DTYPE)
        if np.any(np.diff(index["timestamp_ns"]) <= 0):
            raise _corrupt(path / INDEX_FILE, "timestamps do not increase")
        return cls(path, info, index)

    def verify(self, full: bool = True) -> None:
        """Raises SlambedError for damaged content; `full` also checks the CRC of every frame."""
        if self.groundtruth_file is not None:
            read_groundtruth(self.groundtruth_file)
        if not full:
            return
        size = block_bytes(self.info.sensor, self.info.width, self.info.height)
        for i, crc in enumerate(self.index["crc32"]):
            if zlib.crc32(self._frames[i, :size].data) != crc:
                raise _corrupt(self.path / FRAMES_FILE, f"frame {i} does not fit its CRC")

    @property
    def checksum(self) -> str:
        """Identifies the content (frames, times, camera)."""
        return self.info.checksum

    @property
    def groundtruth_file(self) -> Path | None:
        """The ground truth file in TUM format, if it exists."""
        file = self.path / GROUNDTRUTH_FILE
        return file if file.is_file() else None

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Sequence time of every frame; the first is 0."""
        return np.asarray(self.index["timestamp_ns"] / 1e9, dtype=np.float64)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last frame."""
        return float(self.times_s[-1] - self.times_s[0])

    def groundtruth(self) -> Trajectory | None:
        """Returns the ground truth, if it exists."""
        file = self.groundtruth_file
        return None if file is None else read_groundtruth(file)

    def __len__(self) -> int:
        return self.info.frames

    def __getitem__(self, i: int) -> Frame:
        if not 0 <= i < self.info.frames:
            raise IndexError(i)
        timestamp_ns = round(self.info.time_origin_s * 1e9) + int(self.index["timestamp_ns"][i])
        return Frame(timestamp_ns, self.gray(i), self.second(i))

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))

    def gray(self, i: int) -> GrayImage:
        """Returns the left (or only) gray image."""
        pixels = self.info.width * self.info.height
        return self._frames[i, :pixels].reshape(self.info.height, self.info.width)

    def second(self, i: int) -> SecondImage | None:
        """Returns raw depth (rgbd), the right image (stereo) or None (mono)."""
        if self.info.sensor == "mono":
            return None
        pixels = self.info.width * self.info.height
        rest = self._frames[i, pixels : block_bytes(self.info.sensor, 1, 1) * pixels]
        plane = rest.view("<u2") if self.info.sensor == "rgbd" else rest
        return plane.reshape(self.info.height, self.info.width)


class PreparedWriter:
    """Writes a prepared sequence to a temporary folder and moves it into place when it is complete.

    Used as a context manager: add() appends a frame, and leaving the block finishes the sequence.
    """

    def __init__(
        self,
        path: Path,
        *,
        id: str,
        title: str,
        sensor: Sensor,
        width: int,
        height: int,
        fps: float,
        camera: Camera,
        depth_unit_m: float = 0.0,
        close_depth_baselines: float = 40.0,
        source: dict[str, Any] | None = None,
    ) -> None:
        self.path = Path(path)
        self._partial = partial_folder(self.path)
        self._header: dict[str, Any] = {
            "format": "slambed-sequence",
            "version": 1,
            "id": id,
            "title": title,
            "sensor": sensor,
            "width": width,
            "height": height,
            "frame_stride_bytes": stride_bytes(sensor, width, height),
            "fps": float(fps),
            "camera": camera.model_dump(mode="json"),
            "depth_unit_m": float(depth_unit_m),
            "close_depth_baselines": float(close_depth_baselines),
            "source": source or {},
        }
        self._shape = (height, width)
        self._second_dtype = {"rgbd": np.uint16, "stereo": np.uint8, "mono": None}[sensor]
        self._index: list[tuple[int, int, int]] = []
        self._origin_ns = 0
        self._previous = b""
        self._groundtruth: Trajectory | None = None
        self._file: BinaryIO | None = None

    def __enter__(self) -> PreparedWriter:
        try:
            shutil.rmtree(self._partial, ignore_errors=True)
            self._partial.mkdir(parents=True)
            self._file = (self._partial / FRAMES_FILE).open("wb")
        except OSError as refused:
            raise SlambedError(
                f"{refused.filename}: {refused.strerror}; choose another folder with "
                "SLAMBED_CACHE (or --cache of 'slambed data prepare')"
            ) from refused
        return self

    def add(self, frame: Frame) -> None:
        """Appends a frame; its timestamp must be later than the previous one."""
        assert self._file is not None, "PreparedWriter is used as a context manager"
        if not self._index:
            self._origin_ns = frame.timestamp_ns
        time_ns = frame.timestamp_ns - self._origin_ns
        if self._index and time_ns <= self._index[-1][0]:
            raise SlambedError(
                f"frame {len(self._index)} of {self._header['id']}: timestamp "
                f"{frame.timestamp_ns * 1e-9:.6f} s is not later than the one before; "
                "remove or re-time the frame"
            )
        block = self._block(frame)
        self._file.write(block)
        self._file.write(b"\0" * (self._header["frame_stride_bytes"] - len(block)))
        flags = FLAG_DUPLICATE if block == self._previous else 0
        self._index.append((time_ns, zlib.crc32(block), flags))
        self._previous = block

    def set_groundtruth(self, trajectory: Trajectory) -> None:
        """Sets camera-to-world poses in recorded time."""
        self._groundtruth = trajectory

    def _block(self, frame: Frame) -> bytes:
        planes: list[GrayImage | SecondImage] = [frame.gray.astype(np.uint8, copy=False)]
        if self._second_dtype is not None:
            assert frame.second is not None and frame.second.dtype == self._second_dtype
            planes.append(frame.second)
        for plane in planes:
            if plane.shape != self._shape:
                raise SlambedError(
                    f"frame {len(self._index)} of {self._header['id']} is {plane.shape[1]}x"
                    f"{plane.shape[0]}, not {self._shape[1]}x{self._shape[0]}; "
                    "correct width and height of the dataset's camera"
                )
        return b"".join(plane.astype(plane.dtype.newbyteorder("<")).tobytes() for plane in planes)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        assert self._file is not None
        try:
            # A full disk may show only here.
            self._file.close()
            if kind is None:
                self._finish()
        finally:
            shutil.rmtree(self._partial, ignore_errors=True)

    def _finish(self) -> None:
        if not self._index:
            raise SlambedError(f"{self._header['id']} has no frames; check its source folder")
        index = np.array(self._index, dtype=INDEX_DTYPE).tobytes()
        (self._partial / INDEX_FILE).write_bytes(index)
        self._header["frames"] = len(self._index)
        self._header["time_origin_s"] = self._origin_ns / 1e9
        self._header["checksum"] = sequence_checksum(index, self._header)
        text = json.dumps(self._header, indent=2, ensure_ascii=False) + "\n"
        (self._partial / SEQUENCE_FILE).write_text(text, encoding="utf-8")
        if self._groundtruth is not None:
            write_tum(self._partial / GROUNDTRUTH_FILE, self._groundtruth)
        move_into_place(self._partial, self.path)


def partial_folder(path: Path) -> Path:
    """Returns the temporary folder of an unfinished sequence: hidden, on the same file system."""
    return path.parent / f".{path.name}.partial-{os.getpid()}"


def move_into_place(partial: Path, path: Path) -> None:
    """Moves the finished folder to its place, replacing an older one."""
    retired = path.parent / f".{path.name}.old-{os.getpid()}"
    if path.exists():
        path.rename(retired)
    partial.rename(path)
    shutil.rmtree(retired, ignore_errors=True)


def _corrupt(where: Path, what: str) -> SlambedError:
    return SlambedError(f"prepared sequence damaged: {where}: {what}; delete it and prepare again")
