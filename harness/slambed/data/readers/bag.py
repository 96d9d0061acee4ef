# SPDX-License-Identifier: Apache-2.0
"""ROS 1 bags, ROS 2 bags (sqlite3, MCAP) and single MCAP files, read without ROS by `rosbags`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.rosbag1 import ReaderError as ReaderError1
from rosbags.rosbag2 import ReaderError as ReaderError2
from rosbags.typesys import Stores, get_typestore

from slambed.data.association import MAX_DIFFERENCE_S, pairs_of_sensors
from slambed.data.images import decode
from slambed.data.model import Frame
from slambed.data.readers.base import ReaderOptions, SequenceReader
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError
from slambed.suggestion import did_you_mean

#: compressed_depth_image_transport puts this many bytes before the PNG.
_COMPRESSED_DEPTH_HEADER_BYTES = 12


class Reader(SequenceReader):
    """Two image topics paired by header stamp.

    reader_options: first_topic (grey or colour), second_topic (depth or right image),
    groundtruth_topic (PoseStamped, TransformStamped or Odometry of the camera in the world),
    max_difference_s (0.02).
    """

    known_options = ("first_topic", "second_topic", "groundtruth_topic", "max_difference_s")

    def __init__(self, path: Path, options: ReaderOptions) -> None:
        super().__init__(path, options)
        self._second = None if options.sensor == "mono" else self._topic_option("second_topic")
        self._first = self._topic_option("first_topic")

    @cached_property
    def _pairs(self) -> list[tuple[int, int | None]]:
        """Stamps that belong together; found by reading the whole bag once."""
        times: dict[str, list[int]] = {self._first: []}
        if self._second:
            times[self._second] = []
        with self._open() as bag:
            for topic, message in self._messages(bag, list(times)):
                times[topic].append(_stamp_ns(message))
        first = sorted(set(times[self._first]))
        if self._second is None:
            pairs: list[tuple[int, int | None]] = [(t, None) for t in first]
        else:
            second = sorted(set(times[self._second]))
            limit_s = float(self.options.extra.get("max_difference_s", MAX_DIFFERENCE_S))
            pairs = [(first[i], second[j]) for i, j in pairs_of_sensors(first, second, limit_s)]
        if not pairs:
            raise SlambedError(
                f"{self.path}: no pair of images on {', '.join(times)}; check the topics"
            )
        return pairs

    def __len__(self) -> int:
        return len(self._pairs)

    def __iter__(self) -> Iterator[Frame]:
        wanted = {self._first: {a for a, _ in self._pairs}}
        if self._second:
            wanted[self._second] = {b for _, b in self._pairs if b is not None}
        waiting: dict[tuple[str, int], Any] = {}
        position = 0
        with self._open() as bag:
            for topic, message in self._messages(bag, list(wanted)):
                if (stamp := _stamp_ns(message)) in wanted[topic]:
                    waiting.setdefault((topic, stamp), message)
                while position < len(self._pairs):
                    a, b = self._pairs[position]
                    keys = [(self._first, a)]
                    if self._second is not None and b is not None:
                        keys.append((self._second, b))
                    if not all(key in waiting for key in keys):
                        break
                    yield self._frame(a, [waiting.pop(key) for key in keys])
                    position += 1

    def files(self) -> Iterable[Path]:
        yield from sorted(self.path.iterdir()) if self.path.is_dir() else [self.path]

    def trajectory(self) -> Trajectory | None:
        topic = self.options.extra.get("groundtruth_topic")
        if topic is None:
            return None
        with self._open() as bag:
            rows = {_stamp_ns(m): _pose(m) for _, m in self._messages(bag, [str(topic)])}
        table = np.array([[stamp * 1e-9, *rows[stamp]] for stamp in sorted(rows)])
        return Trajectory.of_rows(table.reshape(-1, 8))

    def _frame(self, stamp: int, messages: list[Any]) -> Frame:
        grey = _grey(messages[0], f"{self.path} {self._first}")
        if self.options.sensor == "mono":
            return Frame(stamp, grey, None)
        name = f"{self.path} {self._second}"
        if self.options.sensor == "stereo":
            return Frame(stamp, grey, _grey(messages[1], name))
        return Frame(stamp, grey, _depth(messages[1], name, self.options.depth_unit_m))

    def _topic_option(self, name: str) -> str:
        if name not in self.options.extra:
            raise SlambedError(f"{self.path}: reader_options needs {name} (see 'rosbags' topics)")
        return str(self.options.extra[name])

    @contextmanager
    def _open(self) -> Iterator[AnyReader]:
        try:
            store = get_typestore(Stores.ROS2_HUMBLE)
            with AnyReader([self.path], default_typestore=store) as bag:
                yield bag
        except (AnyReaderError, ReaderError1, ReaderError2) as broken:
            what = " ".join(str(part) for part in broken.args)
            raise SlambedError(f"{self.path}: cannot be read as a bag: {what}") from broken

    def _messages(self, bag: AnyReader, topics: list[str]) -> Iterator[tuple[str, Any]]:
        present = sorted({connection.topic for connection in bag.connections})
        for topic in topics:
            if topic not in present:
                raise SlambedError(
                    f"{self.path}: no topic '{topic}'{did_you_mean(topic, present)}; "
                    f"in the bag: {', '.join(present)}"
                )
        chosen = [c for c in bag.connections if c.topic in topics]
        for connection, _, raw in bag.messages(connections=chosen):
            yield connection.topic, bag.deserialize(raw, connection.msgtype)


def _stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)


def _pose(message: Any) -> list[float]:
    if hasattr(message, "transform"):
        p, q = message.transform.translation, message.transform.rotation
    else:
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        p, q = pose.position, pose.orientation
    return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]


def _pixels(message: Any, name: str) -> tuple[NDArray[Any], str]:
    """The image as an array, and its encoding; rows may be padded."""
    layouts: dict[str, tuple[str, int]] = {
        "mono8": ("u1", 1), "8UC1": ("u1", 1), "rgb8": ("u1", 3), "bgr8": ("u1", 3),
        "8UC3": ("u1", 3), "rgba8": ("u1", 4), "bgra8": ("u1", 4),
        "mono16": ("u2", 1), "16UC1": ("u2", 1), "32FC1": ("f4", 1),
    }  # fmt: skip
    if message.encoding not in layouts:
        raise SlambedError(f"{name}: encoding '{message.encoding}' is not known; convert the bag")
    kind, channels = layouts[message.encoding]
    dtype = np.dtype((">" if message.is_bigendian else "<") + kind)
    data = np.frombuffer(message.data.tobytes(), np.uint8)
    if data.size < message.height * message.step:
        raise SlambedError(f"{name}: an image is shorter than its header says; record it again")
    rows = data[: message.height * message.step].reshape(message.height, message.step)
    width_bytes = message.width * channels * dtype.itemsize
    image = np.ascontiguousarray(rows[:, :width_bytes]).view(dtype)
    shape = (message.height, message.width) + ((channels,) if channels > 1 else ())
    return image.reshape(shape), str(message.encoding)


def _grey(message: Any, name: str) -> NDArray[np.uint8]:
    if hasattr(message, "format"):
        return decode(message.data.tobytes(), cv2.IMREAD_GRAYSCALE, name).astype(np.uint8)
    image, encoding = _pixels(message, name)
    if image.dtype != np.uint8:
        raise SlambedError(f"{name}: {encoding} is not a grey or colour image; swap the topics?")
    if image.ndim == 2:
        return image
    order = "RGB" if encoding.startswith("rgb") else "BGR"
    code = getattr(cv2, f"COLOR_{order}{'A' if image.shape[2] == 4 else ''}2GRAY")
    return cv2.cvtColor(image, code).astype(np.uint8)


def _depth(message: Any, name: str, unit_m: float) -> NDArray[np.uint16]:
    if hasattr(message, "format"):
        skip = _COMPRESSED_DEPTH_HEADER_BYTES if "compressedDepth" in message.format else 0
        image = decode(message.data.tobytes()[skip:], cv2.IMREAD_UNCHANGED, name)
    else:
        image, _ = _pixels(message, name)
    if image.dtype.kind == "f":  # metres
        metres = np.asarray(image, dtype=np.float64)
        steps = np.nan_to_num(metres, nan=0.0, posinf=0.0, neginf=0.0) / unit_m
        return np.where((steps > 0) & (steps < 65535), np.rint(steps), 0).astype(np.uint16)
    if image.dtype.itemsize != 2 or image.ndim != 2:
        raise SlambedError(f"{name}: depth must be 16UC1, mono16 or 32FC1; swap the topics?")
    return image.astype(np.uint16)
