# SPDX-License-Identifier: Apache-2.0
# ruff: noqa: N803 - frames of reference are written as everywhere: T_wc, camera to world
"""The client of slambed-play for systems in Python (docs/reference/system.md). It needs only numpy.

client = Client()
client.ready()                              # vocabulary loaded, edge connected
for frame in client:                        # ends with playback
    client.pose(frame, T_wc)                # 4x4, camera to world; or client.lost(frame)
client.close()
"""

from __future__ import annotations

import json
import mmap
import os
import socket
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

PROTOCOL = 1
HELLO, INFO, READY, NEXT, FRAME, END, POSE, FINAL, EVENT = range(1, 10)
SENSORS = ("rgbd", "stereo", "mono")
STATES = ("ok", "lost", "not_initialized")
EVENT_BYTES = 4096
ROTATION_TOLERANCE = 0.05
"""Of R R^T - I: chained single precision drifts, and is made a rotation again."""
# These formats must match the structs of slambed_client.h.
_INFO = struct.Struct("=6IQ5d5d2d")
_FRAME = struct.Struct("=2IQqd")
_POSE = struct.Struct("=2IQ3d4d2i")
_TYPE = struct.Struct("=I")


@dataclass(frozen=True)
class Frame:
    """One frame. The pictures are views into memory that is reused after `Client.slots` frames."""

    index: int
    """In the sequence."""
    recorded_ns: int
    """Timestamp of the recording."""
    seq_s: float
    """Since the first played frame."""
    gray: NDArray[np.uint8]
    """(height, width)"""
    depth: NDArray[np.uint16] | None
    """rgbd: in units of `Client.depth_unit_m`, 0 without depth."""
    right: NDArray[np.uint8] | None
    """stereo: the rectified right picture."""


class Client:
    """The connection to the player: receives frames and sends poses."""

    def __init__(self) -> None:
        told = os.environ.get("SLAMBED_CLIENT")
        if told is None:
            sys.exit("error: SLAMBED_CLIENT is not set; let slambed-play start this program")
        socket_fd, memory_fd = map(int, told.split(","))
        self._socket = socket.socket(fileno=socket_fd)
        self._send(_TYPE.pack(HELLO))
        kind, protocol, sensor, self.width, self.height, self.slots, self._slot_bytes, *rest = (
            _INFO.unpack(self._socket.recv(_INFO.size))
        )
        if (kind, protocol) != (INFO, PROTOCOL):
            sys.exit("error: slambed-play speaks another protocol; take its own slambed_client.py")
        self.sensor = SENSORS[sensor]
        self.fx, self.fy, self.cx, self.cy, self.bf = rest[:5]
        self.distortion = np.array(rest[5:10])
        """OpenCV's k1, k2, p1, p2, k3; stereo pictures are rectified."""
        self.depth_unit_m, self.fps = rest[10:]
        self.camera_matrix = np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]])
        self.params: dict[str, Any] = json.loads(os.environ["SLAMBED_PARAMS"])
        self._memory: mmap.mmap | None = None
        if size := self.slots * self._slot_bytes:
            self._memory = mmap.mmap(memory_fd, size, prot=mmap.PROT_READ)

    def ready(self) -> None:
        """Tells the player that the system is ready for the run."""
        self._send(_TYPE.pack(READY))

    def next(self) -> Frame | None:
        """Waits for a frame. Returns None when playback, or on an edge the run, is over."""
        self._send(_TYPE.pack(NEXT))
        packet = self._socket.recv(_FRAME.size)
        if len(packet) < _FRAME.size:
            return None
        _, slot, index, recorded_ns, seq_s = _FRAME.unpack(packet)
        assert self._memory is not None
        pixels, begin = self.width * self.height, slot * self._slot_bytes
        shape = (self.height, self.width)
        depth = right = None
        if self.sensor == "rgbd":
            depth = np.frombuffer(self._memory, "<u2", pixels, begin + pixels).reshape(shape)
        if self.sensor == "stereo":
            right = np.frombuffer(self._memory, "u1", pixels, begin + pixels).reshape(shape)
        gray = np.frombuffer(self._memory, "u1", pixels, begin).reshape(shape)
        return Frame(index, recorded_ns, seq_s, gray, depth, right)

    def __iter__(self) -> Iterator[Frame]:
        while (frame := self.next()) is not None:
            yield frame

    def pose(self, frame: Frame | int, T_wc: Any, features: int = -1, inliers: int = -1) -> None:
        """Reports the pose of a tracked frame: camera to world, 4x4, meters."""
        self._send(self._packed(POSE, 0, frame, T_wc, features, inliers))

    def lost(self, frame: Frame | int, features: int = -1) -> None:
        """Reports that tracking of a frame failed."""
        self._send(self._packed(POSE, 1, frame, np.eye(4), features, -1))

    def not_initialized(self, frame: Frame | int, features: int = -1) -> None:
        """Reports that there is no map, so the frame has no pose."""
        self._send(self._packed(POSE, 2, frame, np.eye(4), features, -1))

    def final(self, frame: Frame | int, T_wc: Any) -> None:
        """Reports the pose of a frame in the finished map, after playback."""
        self._send(self._packed(FINAL, 0, frame, T_wc, -1, -1))

    def event(self, type: str, **fields: Any) -> None:
        """Logs an event for the system's own metrics (`metrics:` in system.yaml)."""
        text = json.dumps({"type": type, **fields}).encode()
        if len(text) > EVENT_BYTES:
            raise ValueError(f"an event has at most {EVENT_BYTES} bytes")
        self._send(_TYPE.pack(EVENT) + text)

    def close(self) -> None:
        """Closes the connection; the program may continue."""
        self._socket.close()

    def _send(self, packet: bytes) -> None:
        self._socket.send(packet, socket.MSG_NOSIGNAL)

    def _packed(
        self, kind: int, state: int, frame: Frame | int, T_wc: Any, features: int, inliers: int
    ) -> bytes:
        index = frame if isinstance(frame, int) else frame.index
        matrix = _pose(T_wc, index)
        q_xyzw = _quaternion(matrix[:3, :3])
        return _POSE.pack(kind, state, index, *matrix[:3, 3], *q_xyzw, features, inliers)


def edge_address(channel: str) -> tuple[str, int]:
    """Returns the address and port where the edge listens for this channel of system.yaml."""
    port = int(os.environ[f"SLAMBED_PORT_{channel.upper()}"])
    return os.environ["SLAMBED_EDGE_ADDRESS"], port


def _pose(T_wc: Any, frame: int) -> NDArray[np.float64]:
    """Returns a pose as a matrix. Raises ValueError for anything else, also for a matrix that is
    scaled, mirrored or transposed: as a quaternion it would be another pose."""
    matrix = np.asarray(T_wc, dtype=float)
    if matrix.shape not in ((4, 4), (3, 4)):
        raise ValueError(f"the pose of frame {frame} has shape {matrix.shape}, expected 4x4")
    if not np.isfinite(matrix).all():
        raise ValueError(f"the pose of frame {frame} has nan or inf; report the frame as lost")
    rotation = matrix[:3, :3]
    apart = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if apart > ROTATION_TOLERANCE or np.linalg.det(rotation) < 0:
        raise ValueError(f"the pose of frame {frame} has no rotation in its first 3x3 numbers")
    if len(matrix) == 4 and not np.allclose(matrix[3], [0, 0, 0, 1], atol=1e-6):
        raise ValueError(f"the last row of the pose of frame {frame} is {matrix[3]}, not 0 0 0 1")
    return matrix


def _quaternion(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns x, y, z, w of a rotation matrix by the eigenvector of Bar-Itzhack (JGCD 2000)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    k = np.array(
        [
            [xx - yy - zz, yx + xy, zx + xz, zy - yz],
            [yx + xy, yy - xx - zz, zy + yz, xz - zx],
            [zx + xz, zy + yz, zz - xx - yy, yx - xy],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    values, vectors = np.linalg.eigh(k / 3.0)
    q: NDArray[np.float64] = vectors[:, int(np.argmax(values))]
    return q if q[3] >= 0 else -q
