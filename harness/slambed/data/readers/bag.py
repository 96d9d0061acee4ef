# SPDX-License-Identifier: Apache-2.0
"""Reads ROS 1 bags, ROS 2 bags (sqlite3, MCAP) and single MCAP files without ROS, by `rosbags`."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Iterator
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader

from slambed.data.association import pairs_of_sensors
from slambed.data.bag_file import BagFile
from slambed.data.images import other_size
from slambed.data.model import Frame
from slambed.data.readers.base import ReaderOptions, SequenceReader
from slambed.data.ros_images import depth_of, gray_of
from slambed.data.ros_poses import is_without_turn, poses_of, truth_of
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError

_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
#: The clocks of header and recorder may differ by a constant offset, but not in their rate.
_CLOCK_RATIO, _CLOCK_SLACK_S = 1.5, 2.0
#: A picture may come after its successor: its stamp is a step earlier then.
_OVERTAKEN_STEPS = 1.5


class Reader(SequenceReader):
    """Reads two image topics paired by header stamp. Parts of a split bag are read as one.

    reader_options: first_topic (gray or color), second_topic (depth or right image),
    groundtruth_topic (PoseStamped, PoseWithCovarianceStamped, TransformStamped, Odometry, Path or
    PointStamped: the camera in the world frame), max_difference_s (0.02).
    """

    known_options = ("first_topic", "second_topic", "groundtruth_topic", "max_difference_s")
    reads_parts = True
    truth_without_key = "say 'reader_options: {groundtruth_topic: TOPIC}'"

    def __init__(self, path: Path, options: ReaderOptions) -> None:
        super().__init__(path, options)
        self._bag = BagFile(
            [path, *(part for part in options.further_parts if _goes_on(path, part))]
        )
        if (others := len(options.further_parts) + 1 - len(self._bag.parts)) > 0:
            self.notes.append(f"{path}: 'paths' matches {others} more that are no parts of it")
        self._second = None if options.sensor == "mono" else self._topic_option("second_topic")
        self._first = self._topic_option("first_topic")
        if self._first == self._second:
            raise SlambedError(
                f"{path}: reader_options: first_topic and second_topic are both '{self._first}'; "
                "name the topic of the second sensor"
            )

    @cached_property
    def _pairs(self) -> list[tuple[int, int | None]]:
        """Paired timestamps; reads the whole bag once."""
        times: dict[str, list[int]] = {self._first: []}
        if self._second:
            times[self._second] = []
        received: list[int] = []
        with self._bag.open() as bag:
            for topic, message, received_ns in self._messages(bag, list(times)):
                times[topic].append(_stamp_ns(message))
                received.append(received_ns)
        for topic, stamps in times.items():
            self._check_stamps(topic, stamps, received)
        first = sorted(set(times[self._first]))
        if self._second is None:
            pairs: list[tuple[int, int | None]] = [(t, None) for t in first]
        else:
            second = sorted(set(times[self._second]))
            found = pairs_of_sensors(first, second, self.max_difference_s)
            pairs = [(first[i], second[j]) for i, j in found]
            self._note_unpaired(len(first), len(pairs))
        if not pairs:
            raise SlambedError(
                f"{self.path}: no pair of images on {', '.join(times)}; check the topics"
            )
        return pairs

    def _check_stamps(self, topic: str, stamps: list[int], received: list[int]) -> None:
        if len(stamps) > 1 and not any(stamps):
            raise SlambedError(
                f"{self.path} {topic}: all header stamps are zero; let the driver stamp its images"
            )
        self._check_order(topic, stamps)
        if (again := len(stamps) - len(set(stamps))) > 0:
            self.notes.append(
                f"{self.path} {topic}: {again} images have the stamp of another one and are left "
                "out, but for the first"
            )
        own_s, bag_s = (1e-9 * (max(t) - min(t)) if t else 0.0 for t in (stamps, received))
        if max(own_s, bag_s) > _CLOCK_RATIO * min(own_s, bag_s) + _CLOCK_SLACK_S:
            self.notes.append(
                f"{self.path} {topic}: header stamps last {own_s:.1f} s and the bag {bag_s:.1f} s; "
                "frames are played by their header stamps"
            )

    def _check_order(self, topic: str, stamps: list[int]) -> None:
        """Pictures may overtake each other, and are sorted then. A clock that was set back would
        mix what was recorded before and after."""
        steps = [b - a for a, b in pairwise(stamps)]
        back = [-step for step in steps if step < 0]
        if not back:
            return
        usual = statistics.median([step for step in steps if step > 0] or [0])
        if max(back) > _OVERTAKEN_STEPS * usual:
            at = next(i for i, step in enumerate(steps) if -step == max(back))
            raise SlambedError(
                f"{self.path} {topic} message {at + 2}: header stamps go back by "
                f"{max(back) * 1e-9:.6f} s; was the clock set while recording? Cut the bag there"
            )
        self.notes.append(
            f"{self.path} {topic}: {len(back)} images have an earlier stamp than the one before; "
            "frames are played in the order of their stamps"
        )

    def __len__(self) -> int:
        return len(self._pairs)

    def times_ns(self) -> list[int]:
        return [first for first, _ in self._pairs]

    def place(self, i: int) -> str:
        return f"{self.path} {self._first}"

    def __iter__(self) -> Iterator[Frame]:
        wanted = {self._first: {a for a, _ in self._pairs}}
        if self._second:
            wanted[self._second] = {b for _, b in self._pairs if b is not None}
        waiting: dict[tuple[str, int], Any] = {}
        position = 0
        with self._bag.open() as bag:
            for topic, message, _ in self._messages(bag, list(wanted)):
                if (stamp := _stamp_ns(message)) in wanted[topic]:
                    # A second image of this stamp would wait for ever.
                    wanted[topic].discard(stamp)
                    waiting[topic, stamp] = message
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
        for part in self._bag.parts:
            yield from sorted(part.iterdir()) if part.is_dir() else [part]

    def trajectory(self) -> Trajectory | None:
        topic = self.options.extra.get("groundtruth_topic")
        if topic is None:
            return None
        where = f"{self.path} {topic}"
        with self._bag.open() as bag:
            messages = (message for _, message, _ in self._messages(bag, [str(topic)]))
            poses = poses_of(messages, where)
        if is_without_turn(poses):
            self.notes.append(f"{where}: points have no orientation, so there is no RPE")
        return truth_of(poses, where)

    def _frame(self, stamp: int, messages: list[Any]) -> Frame:
        where = f"{stamp * 1e-9:.6f} s of {self.path}"
        gray = gray_of(messages[0], f"{where} {self._first}", self.gray_range)
        size = self.options.size
        if size is not None and gray.shape[::-1] != size:
            raise SlambedError(
                f"{where} {self._first}: a picture of {gray.shape[1]}x{gray.shape[0]} pixels, the "
                f"dataset's camera has {size[0]}x{size[1]}; correct its width and height"
            )
        if self.options.sensor == "mono":
            return Frame(stamp, gray, None)
        name = f"{where} {self._second}"
        is_stereo = self.options.sensor == "stereo"
        second = (
            gray_of(messages[1], name, self.gray_range)
            if is_stereo
            else depth_of(messages[1], name, self.options.depth_unit_m)
        )
        if second.shape != gray.shape:
            what = "the right picture" if is_stereo else "depth"
            raise other_size(name, what, second.shape[::-1], gray.shape[::-1])
        return Frame(stamp, gray, second)

    def _topic_option(self, name: str) -> str:
        if name not in self.options.extra:
            raise SlambedError(
                f"{self.path}: reader_options needs {name}, a topic of the bag ('ros2 bag info' or "
                "'rosbag info' lists them)"
            )
        return str(self.options.extra[name])

    def _messages(self, bag: AnyReader, topics: list[str]) -> Iterator[tuple[str, Any, int]]:
        return self._bag.messages(bag, topics, self._check_kind)

    def _check_kind(self, topic: str, kind: str) -> None:
        if topic in (self._first, self._second) and kind not in _IMAGES:
            raise SlambedError(
                f"{self.path}: topic '{topic}' has {kind}, expected {' or '.join(_IMAGES)}; "
                "name the topic of the pictures"
            )


def _goes_on(first: Path, part: Path) -> bool:
    """Returns whether `part` belongs to the same recording: same folder and same type."""
    same_kind = (first.suffix, first.is_dir()) == (part.suffix, part.is_dir())
    return same_kind and first.parent == part.parent


def _stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)
