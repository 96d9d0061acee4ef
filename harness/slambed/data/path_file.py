# SPDX-License-Identifier: Apache-2.0
"""The trajectory in a file of any common kind: TUM's lines, KITTI's matrices, or a topic of a ROS
bag. Used where a user names two files to compare."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from slambed.data.kitti_poses import KITTI_COLUMNS, matrices_of, pose_lines
from slambed.data.pose_columns import named_columns
from slambed.data.ros_poses import POSE_TYPES, POSES_KNOWN, poses_of, truth_of
from slambed.data.text_file import fields, must_be_regular, pose_rows, read_lines, table_lines
from slambed.data.trajectory import Trajectory, read_tum, repeated_times
from slambed.data.truth_times import in_seconds
from slambed.errors import SlambedError

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

KITTI_PERIOD_S = 0.1
"""KITTI's camera takes ten frames a second."""
_BAGS = (b"#ROSBAG", b"\x89MCAP", b"SQLite format 3\0")


@dataclass(frozen=True)
class PathFile:
    """A trajectory with times in seconds, and how its file tells them."""

    trajectory: Trajectory
    kind: Literal["tum", "kitti", "bag"]
    notes: list[str] = field(default_factory=list)
    has_times: bool = True
    """False for KITTI's poses without a file of times: pose N is at N times KITTI_PERIOD_S."""


def read_path(path: Path, *, topic: str | None = None, times: Path | None = None) -> PathFile:
    """Reads a trajectory; `topic` is for bags, `times` for KITTI's poses.

    Raises SlambedError for a file that is none of these kinds, or with an option of another kind.
    """
    kind = _kind_of(path)
    if topic is not None and kind != "bag":
        raise SlambedError(f"{path}: a topic is named ('{topic}'), but this is no ROS bag")
    if kind == "bag":
        return _of_bag(path, topic)
    if kind == "kitti":
        return _of_kitti(path, times)
    found, notes = in_seconds(read_tum(path), str(path))
    if len(found) > 1 and np.ptp(found.stamps_s) == 0:
        raise SlambedError(
            f"{path}: all {len(found)} poses have the time {found.stamps_s[0]:.6f} s; record time "
            "stamps"
        )
    if again := repeated_times(found):
        notes = [*notes, f"{path}: poses that differ from another one of the same time: {again}"]
    return PathFile(found, "tum", notes)


def check_comparable(estimate: PathFile, truth: PathFile) -> None:
    """Raises SlambedError if poses without times cannot be assigned to each other."""
    if estimate.has_times != truth.has_times:
        which = "ground truth" if estimate.has_times else "estimate"
        raise SlambedError(
            f"KITTI's poses in the {which} have no times; give a file of times (--times)"
        )
    counts = len(estimate.trajectory), len(truth.trajectory)
    if not estimate.has_times and counts[0] != counts[1]:
        raise SlambedError(
            f"{counts[0]} poses of KITTI in the estimate and {counts[1]} in the ground truth: "
            "without times they go by line, so a line for each frame is needed in both"
        )


def _kind_of(path: Path) -> Literal["tum", "kitti", "bag"]:
    try:
        if path.is_dir():
            if not (path / "metadata.yaml").is_file():
                raise SlambedError(f"{path}: a folder, and no ROS 2 bag: it has no metadata.yaml")
            return "bag"
        must_be_regular(path)
        with path.open("rb") as file:
            start = file.read(max(map(len, _BAGS)))
    except OSError as refused:
        raise SlambedError(f"{path}: cannot be read: {refused.strerror}") from refused
    if start.startswith(_BAGS):
        return "bag"
    if named_columns(read_lines(path), str(path)) is None:
        first = next((fields(line) for _, line in table_lines(path)), [])
        if len(first) == KITTI_COLUMNS:
            return "kitti"
    return "tum"


def _of_kitti(path: Path, times: Path | None) -> PathFile:
    rows = pose_lines(path)
    matrices = matrices_of(rows, path)
    if times is None:
        stamps_s = KITTI_PERIOD_S * np.arange(len(rows), dtype=np.float64)
        note = f"{path}: KITTI's poses have no times; they are taken as {KITTI_PERIOD_S:g} s apart"
        return PathFile(Trajectory.of_matrices(stamps_s, matrices), "kitti", [note], False)
    rows_of_times = pose_rows(times, 1, "a time in seconds")
    stamps = [values[0] for _, values in rows_of_times]
    if len(stamps) != len(rows):
        raise SlambedError(
            f"{times}: {len(stamps)} times for the {len(rows)} poses of {path}; expected a line "
            "for each"
        )
    for (line, _), before, after in zip(rows_of_times[1:], stamps, stamps[1:], strict=False):
        if after <= before:
            raise SlambedError(
                f"{times}:{line}: {after:.6f} is not later than {before:.6f}; is this the file of "
                "these poses?"
            )
    found, notes = in_seconds(Trajectory.of_matrices(np.array(stamps), matrices), str(times))
    return PathFile(found, "kitti", notes)


def _of_bag(path: Path, topic: str | None) -> PathFile:
    from slambed.data.bag_file import BagFile  # `rosbags` is slow to import

    recording = BagFile([path])
    with recording.open() as bag:
        chosen = _pose_topic(bag, path) if topic is None else topic
        where = f"{path} {chosen}"
        messages = (message for _, message, _ in recording.messages(bag, [chosen]))
        poses = poses_of(messages, where)
    if not poses:
        raise SlambedError(f"{where}: no pose in it; name another topic")
    found, notes = truth_of(poses, where), []
    if not found.has_orientation:
        notes = [f"{where}: points have no orientation, so there is no RPE"]
    return PathFile(found, "bag", notes)


def _pose_topic(bag: AnyReader, path: Path) -> str:
    """Returns the only topic with poses."""
    found = sorted({c.topic for c in bag.connections if c.msgtype in POSE_TYPES})
    if len(found) == 1:
        return found[0]
    if found:
        raise SlambedError(
            f"{path}: poses on {', '.join(found)}; name one of them (--topic, of the "
            "ground truth --truth-topic)"
        )
    raise SlambedError(f"{path}: no topic with poses; known: {POSES_KNOWN}")
