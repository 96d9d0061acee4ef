# SPDX-License-Identifier: Apache-2.0
"""Exports a sequence as a ROS 2 bag with MCAP storage, without ROS, by `rosbags`.

Images and camera_info follow ROS conventions: topic names of image_pipeline, depth by REP 118,
frames by REP 103 (optical: x right, y down, z forward), like ours.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from slambed.data.export_part import Part

TOPICS = {
    "mono": ("/camera/image_raw",),
    "rgbd": ("/camera/image_raw", "/camera/depth/image_raw"),
    "stereo": ("/left/image_raw", "/right/image_raw"),
}
"""Sensor -> image topics."""
GROUNDTRUTH = "/groundtruth"
WORLD, CAMERA = "world", "camera_optical_frame"
MILLIMETER_M = 0.001
"""REP 118 allows integer millimeters as 16UC1; any other depth is in meters as 32FC1."""
IMAGE, INFO, POSE = (
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CameraInfo",
    "geometry_msgs/msg/PoseStamped",
)


def write_bag(part: Part, folder: Path) -> None:
    """Writes gray images, depth or right images, their camera_info, and the true pose of the
    left camera, sorted by time; creates `folder`."""
    Bag(part).write(folder)


class Bag:
    """The messages of one sequence."""

    def __init__(self, part: Part) -> None:
        self.part = part
        self.info = part.sequence.info
        self.store = get_typestore(Stores.ROS2_HUMBLE)
        self.topics = TOPICS[self.info.sensor]

    def write(self, folder: Path) -> None:
        """Writes all messages."""
        bag = Writer(folder, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP)
        with bag:

            def topic(name: str, kind: str) -> Callable[[int, Any], None]:
                connection = bag.add_connection(name, kind, typestore=self.store)

                def put(time_ns: int, message: Any) -> None:
                    bag.write(connection, time_ns, self.store.serialize_cdr(message, kind))

                return put

            images = [topic(name, IMAGE) for name in self.topics]
            infos = [topic(name.replace("image_raw", "camera_info"), INFO) for name in self.topics]
            poses = self._poses()
            put_pose = topic(GROUNDTRUTH, POSE) if poses else None
            for frame in self.part.frames():
                while put_pose is not None and poses and poses[0][0] <= frame.timestamp_ns:
                    put_pose(*poses.pop(0))
                planes = self._planes(frame.gray, frame.second)
                for index, (plane, encoding) in enumerate(planes):
                    header = self._header(frame.timestamp_ns, CAMERA)
                    images[index](frame.timestamp_ns, self._image(header, plane, encoding))
                    infos[index](frame.timestamp_ns, self._info(header, index))
            for time_ns, pose in poses:
                assert put_pose is not None
                put_pose(time_ns, pose)

    def _planes(self, gray: Any, second: Any) -> Iterator[tuple[NDArray[Any], str]]:
        yield gray, "mono8"
        if self.info.sensor == "stereo":
            yield second, "mono8"
        elif self.info.sensor == "rgbd" and self.info.depth_unit_m == MILLIMETER_M:
            yield second, "16UC1"
        elif self.info.sensor == "rgbd":
            meters = second.astype(np.float32) * np.float32(self.info.depth_unit_m)
            yield np.where(second == 0, np.float32(np.nan), meters), "32FC1"

    def _type(self, name: str, **fields: Any) -> Any:
        return self.store.types[name](**fields)

    def _header(self, time_ns: int, frame: str) -> Any:
        seconds, rest = divmod(time_ns, 1_000_000_000)
        stamp = self._type("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)
        return self._type("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def _image(self, header: Any, plane: NDArray[Any], encoding: str) -> Any:
        rows = np.ascontiguousarray(plane, plane.dtype.newbyteorder("<"))
        return self._type(
            IMAGE,
            header=header,
            height=rows.shape[0],
            width=rows.shape[1],
            encoding=encoding,
            is_bigendian=0,
            step=rows.strides[0],
            data=rows.view(np.uint8).reshape(-1),
        )

    def _info(self, header: Any, index: int) -> Any:
        camera, info = self.info.camera, self.info
        # P of the right camera contains -fx * baseline, as in CameraInfo.msg.
        right = -camera.bf if info.sensor == "stereo" and index == 1 else 0.0
        k = np.array([camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1], np.float64)
        p = np.insert(k.reshape(3, 3), 3, [right, 0.0, 0.0], axis=1).reshape(-1)
        return self._type(
            INFO,
            header=header,
            height=info.height,
            width=info.width,
            distortion_model="plumb_bob",
            d=np.array(camera.distortion),
            k=k,
            r=np.eye(3).reshape(-1),
            p=p,
            binning_x=0,
            binning_y=0,
            roi=self._whole,
        )

    @cached_property
    def _whole(self) -> Any:
        return self._type(
            "sensor_msgs/msg/RegionOfInterest",
            x_offset=0,
            y_offset=0,
            height=0,
            width=0,
            do_rectify=False,
        )

    def _poses(self) -> list[tuple[int, Any]]:
        """Returns the true poses with their times in ns, earliest first."""
        truth = self.part.truth()
        found = []
        for t_s, x, y, z, qx, qy, qz, qw in [] if truth is None else truth.rows().tolist():
            time_ns = round(t_s * 1e9)
            pose = self._type(
                "geometry_msgs/msg/Pose",
                position=self._type("geometry_msgs/msg/Point", x=x, y=y, z=z),
                orientation=self._type("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
            )
            found.append(
                (time_ns, self._type(POSE, header=self._header(time_ns, WORLD), pose=pose))
            )
        return found
