# SPDX-License-Identifier: Apache-2.0
"""A prepared sequence with simple ground truth: a camera that moves sideways along a wall."""

from pathlib import Path

import cv2
import numpy as np

from slambed.data.model import Camera, Frame
from slambed.data.prepared import PreparedSequence, PreparedWriter
from slambed.data.trajectory import Trajectory

CAMERA = Camera(fx=300.0, fy=310.0, cx=160.0, cy=120.0, bf=20.0)
WIDTH, HEIGHT = 320, 240
WALL_M, STEP_M, FPS = 2.0, 0.02, 10.0
UNIT_M = 0.001


def wall(seed: int) -> np.ndarray:
    """An image of blobs, wider than the camera's."""
    rng = np.random.default_rng(seed)
    small = rng.integers(0, 256, (60, 200), dtype=np.uint8)
    return np.asarray(cv2.resize(small, (1000, 300), interpolation=cv2.INTER_NEAREST))


def write_walk(
    path: Path, frames: int = 26, sensor: str = "rgbd", strange: bool = False, truth: bool = True
) -> PreparedSequence:
    """A camera that moves sideways along a wall at 2 m: 3 px per frame. strange: every frame
    shows another wall."""
    depth = np.full((HEIGHT, WIDTH), round(WALL_M / UNIT_M), np.uint16)
    poses = []
    with PreparedWriter(
        path,
        id=path.name,
        title=path.name,
        sensor=sensor,
        width=WIDTH,
        height=HEIGHT,
        fps=FPS,
        camera=CAMERA,
        depth_unit_m=UNIT_M if sensor == "rgbd" else 0.0,
    ) as writer:
        for k in range(frames):
            left = round(k * STEP_M * CAMERA.fx / WALL_M)
            gray = np.ascontiguousarray(wall(k if strange else 0)[:HEIGHT, left : left + WIDTH])
            writer.add(Frame(k * 100_000_000, gray, depth if sensor == "rgbd" else None))
            poses.append([k / FPS, k * STEP_M, 0, 0, 0, 0, 0, 1])
        if truth:
            writer.set_groundtruth(Trajectory.of_rows(np.array(poses, np.float64)))
    return PreparedSequence.open(path)
