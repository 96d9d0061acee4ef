# SPDX-License-Identifier: Apache-2.0
"""Ground-truth poses of the camera at every frame, and the motion of points between images."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Slerp

from slambed.data.model import Camera
from slambed.data.prepared import PreparedSequence
from slambed.errors import SlambedError

Floats = NDArray[np.float64]

LONGEST_GAP_S = 0.25
"""Maximum time between two true poses for interpolation."""


@dataclass(frozen=True)
class CameraMotion:
    """Interpolated ground-truth poses T_wc [N,4,4] of all frames; NaN where unknown."""

    poses: Floats

    @classmethod
    def of(cls, sequence: PreparedSequence) -> CameraMotion:
        """Interpolates the ground truth of a sequence. Raises SlambedError if it has
        none, or positions alone."""
        truth = sequence.groundtruth()
        if truth is None or len(truth) < 2:
            raise SlambedError(
                f"{sequence.info.id} has no ground truth, which says where points go; "
                "choose a sequence that has"
            )
        if not truth.has_orientation:
            raise SlambedError(
                f"the ground truth of {sequence.info.id} has positions alone, and where points go "
                "depends on how the camera turned; choose a sequence with poses"
            )
        times_s = sequence.info.time_origin_s + sequence.times_s
        stamps_s = truth.stamps_s
        after = np.clip(np.searchsorted(stamps_s, times_s), 1, len(stamps_s) - 1)
        before = after - 1
        known = (times_s >= stamps_s[0]) & (times_s <= stamps_s[-1])
        known &= stamps_s[after] - stamps_s[before] <= LONGEST_GAP_S
        poses = np.full((len(times_s), 4, 4), np.nan)
        poses[known] = np.eye(4)
        turns = Slerp(stamps_s, truth.rotations())
        poses[known, :3, :3] = turns(times_s[known]).as_matrix()
        for axis in range(3):
            poses[known, axis, 3] = np.interp(times_s[known], stamps_s, truth.positions_m[:, axis])
        return cls(poses)

    def knows(self, frame: int) -> bool:
        """Returns whether the frame has a true pose."""
        return bool(np.isfinite(self.poses[frame, 0, 0]))

    def between(self, first: int, second: int) -> Floats:
        """Returns T_second_first, which transforms points from the first to the second camera's
        frame."""
        relative: Floats = np.linalg.inv(self.poses[second]) @ self.poses[first]
        return relative


def camera_matrix(camera: Camera) -> Floats:
    return np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])


def rays_of(camera: Camera, pixels: Floats) -> Floats:
    """Returns undistorted viewing rays with z = 1: [N,3]."""
    if not len(pixels):
        return np.empty((0, 3))
    flat = cv2.undistortPoints(
        pixels.reshape(-1, 1, 2), camera_matrix(camera), np.array(camera.distortion)
    )
    return np.column_stack([flat.reshape(-1, 2).astype(np.float64), np.ones(len(pixels))])


def moved_to(
    camera: Camera, relative: Floats, pixels: Floats, depths_m: Floats
) -> tuple[Floats, Floats]:
    """Projects points of one image into another: pixels [N,2] and depths [N] (0: behind the
    camera)."""
    points = rays_of(camera, pixels) * depths_m[:, None]
    points = points @ relative[:3, :3].T + relative[:3, 3]
    depths = np.where(points[:, 2] > 0, points[:, 2], 0.0)
    ahead = np.where(depths[:, None] > 0, points, [0.0, 0.0, 1.0])
    if not len(ahead):
        return np.empty((0, 2)), depths
    none = np.zeros(3)
    seen, _ = cv2.projectPoints(
        ahead, none, none, camera_matrix(camera), np.array(camera.distortion)
    )
    return seen.reshape(-1, 2).astype(np.float64), depths


def epipolar_distance_px(
    camera: Camera, relative: Floats, pixels: Floats, others: Floats
) -> Floats:
    """Returns the distances of features in the second image from the epipolar lines of the
    first, undistorted."""
    t = relative[:3, 3]
    cross = np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])
    lines = rays_of(camera, pixels) @ (cross @ relative[:3, :3]).T
    along = np.abs(np.sum(lines * rays_of(camera, others), axis=1))
    slope = np.hypot(lines[:, 0] / camera.fx, lines[:, 1] / camera.fy)
    with np.errstate(divide="ignore", invalid="ignore"):
        distances: Floats = np.where(slope > 0, along / slope, np.inf)
    return distances
