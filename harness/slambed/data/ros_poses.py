# SPDX-License-Identifier: Apache-2.0
"""Reads ground truth from ROS messages of any type with a stamped camera pose."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from slambed.data.rotations import check_quaternions
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError

POSE_TYPES = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/Path",
    "geometry_msgs/msg/PointStamped",
)
POSES_KNOWN = ", ".join(name.rpartition("/")[2] for name in POSE_TYPES)

#: Position, and orientation as x y z w; a point has no orientation.
Pose = list[float]
_NO_TURN = 3


def poses_of(messages: Iterable[Any], where: str) -> dict[int, Pose]:
    """Returns timestamp in nanoseconds -> pose; repeated poses of Path messages take the latest
    value."""
    poses: dict[int, Pose] = {}
    frames: set[str] = set()
    for number, message in enumerate(messages, 1):
        frames.add(getattr(message, "child_frame_id", ""))
        if len(frames) > 1:
            raise SlambedError(
                f"{where} message {number}: poses of several frames ({', '.join(sorted(frames))}); "
                "record those of one frame on a topic of its own"
            )
        for stamped in _stamped(message, where):
            stamp = stamped.header.stamp
            pose = _pose(stamped, where)
            if not np.isfinite(pose).all():
                raise SlambedError(
                    f"{where} message {number}: not finite: {' '.join(f'{v:g}' for v in pose)}; "
                    "expected a pose; leave out what was not tracked"
                )
            poses[int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)] = pose
    if len(poses) == 1 and 0 in poses:
        raise SlambedError(f"{where}: poses have no time stamps of their own; record them stamped")
    return poses


def is_without_turn(poses: dict[int, Pose]) -> bool:
    """Returns True for points, which have no orientation."""
    return any(len(pose) == _NO_TURN for pose in poses.values())


def truth_of(poses: dict[int, Pose], where: str) -> Trajectory:
    """Returns the poses sorted by time; points get the identity orientation."""
    if not poses:
        raise SlambedError(f"{where}: no pose in it; remove groundtruth_topic to go without")
    rows = [
        [stamp * 1e-9, *pose, *([0.0, 0.0, 0.0, 1.0] if len(pose) == _NO_TURN else [])]
        for stamp, pose in sorted(poses.items())
    ]
    table = np.array(rows)
    check_quaternions(table[:, 4:8], [f"{where} at {row[0]:.6f} s" for row in rows])
    return replace(Trajectory.of_rows(table), has_orientation=not is_without_turn(poses))


def _stamped(message: Any, where: str) -> Iterator[Any]:
    """Yields the parts of a message with a header and a pose."""
    if hasattr(message, "poses"):
        yield from (pose for pose in message.poses if _is_stamped(pose, where))
    elif _is_stamped(message, where):
        yield message


def _is_stamped(message: Any, where: str) -> bool:
    if not hasattr(getattr(getattr(message, "header", None), "stamp", None), "nanosec"):
        raise _unknown(message, where)
    return True


def _pose(message: Any, where: str) -> Pose:
    try:
        return [float(value) for value in _numbers(message, where)]
    except (AttributeError, TypeError, ValueError):
        raise _unknown(message, where) from None


def _numbers(message: Any, where: str) -> Pose:
    if hasattr(message, "point"):
        return [message.point.x, message.point.y, message.point.z]
    if hasattr(message, "transform"):
        p, q = message.transform.translation, message.transform.rotation
    elif hasattr(message, "pose"):
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        p, q = pose.position, pose.orientation
    else:
        raise _unknown(message, where)
    return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]


def _unknown(message: Any, where: str) -> SlambedError:
    kind = type(message).__name__.replace("__", "/")
    return SlambedError(f"{where}: {kind} is no ground truth that is known; known: {POSES_KNOWN}")
