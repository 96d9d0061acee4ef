# SPDX-License-Identifier: Apache-2.0
"""Tiny recordings in every format, created on demand for the data tests."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from slambed.data.model import Camera, Frame
from slambed.data.prepared import PreparedSequence, PreparedWriter
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError

WIDTH, HEIGHT = 64, 48
CAMERA = Camera(fx=50.0, fy=50.0, cx=31.5, cy=23.5, bf=4.0)


def gray(i: int, width: int = WIDTH, height: int = HEIGHT) -> NDArray[np.uint8]:
    """A random image that depends only on its number."""
    return np.random.default_rng(i).integers(0, 256, (height, width), dtype=np.uint8)


def depth(i: int, meters: float = 2.0, unit_m: float = 0.0002) -> NDArray[np.uint16]:
    """Depth around the given distance, with one row of holes."""
    plane = np.full((HEIGHT, WIDTH), round(meters / unit_m) + i, dtype=np.uint16)
    plane[0] = 0
    return plane


def trajectory(times_s: list[float]) -> Trajectory:
    """A straight walk without rotation."""
    rows = [[t, 0.1 * t, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0] for t in times_s]
    return Trajectory.of_rows(np.array(rows))


def write_prepared(path: Path, frames: int = 4) -> PreparedSequence:
    """An RGB-D sequence whose third frame repeats the second."""
    with PreparedWriter(
        path,
        id="tiny",
        title="Tiny, größer als nichts",
        sensor="rgbd",
        width=WIDTH,
        height=HEIGHT,
        fps=10.0,
        camera=CAMERA,
        depth_unit_m=0.0002,
    ) as writer:
        for i in range(frames):
            picture = 1 if i == 2 else i
            time_ns = 1_000_000_000_000 + i * 100_000_000
            writer.add(Frame(time_ns, gray(picture), depth(picture)))
        writer.set_groundtruth(trajectory([1000.0, 1000.1, 1000.2]))
    return PreparedSequence.open(path)


def write_tum(path: Path, frames: int = 6, meters: float = 2.0) -> Path:
    """TUM layout; depth images 4 ms after the color images, one of them missing."""
    (path / "rgb").mkdir(parents=True)
    (path / "depth").mkdir()
    color_lines, depth_lines, poses = ["# color"], ["# depth"], ["# poses"]
    for i in range(frames):
        t, t_depth = 1305031102.175304 + i / 10, 1305031102.179304 + i / 10
        cv2.imwrite(str(path / f"rgb/{t:.6f}.png"), gray(i))
        color_lines.append(f"{t:.6f} rgb/{t:.6f}.png")
        poses.append(f"{t:.4f} {i} 0 0 0 0 0 1")
        if i != 3:
            cv2.imwrite(str(path / f"depth/{t_depth:.6f}.png"), depth(i, meters))
            depth_lines.append(f"{t_depth:.6f} depth/{t_depth:.6f}.png")
    (path / "rgb.txt").write_text("\n".join(color_lines) + "\n")
    (path / "depth.txt").write_text("\n".join(depth_lines) + "\n")
    (path / "groundtruth.txt").write_text("\n".join(poses) + "\n")
    return path


def tum_recipe(folder: Path, name: str = "tiny_tum", **extra: str) -> Path:
    """A dataset file for write_tum's folder of the same name."""
    keys = {
        "id": name,
        "title": "Tiny TUM folder",
        "reader": "tum",
        "paths": f"[{name}]",
        "depth_unit_m": "0.0002",
        "fps": "10",
        "groundtruth": "groundtruth.txt",
        "camera": f"{{ width: {WIDTH}, height: {HEIGHT}, fx: 50, fy: 50, "
        "cx: 31.5, cy: 23.5, bf: 4 }",
    } | extra
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}.yaml"
    file.write_text("".join(f"{key}: {value}\n" for key, value in keys.items()))
    return file


def one_line(error: pytest.ExceptionInfo[SlambedError]) -> str:
    """Returns the message, which must be a single line."""
    line = str(error.value)
    assert "\n" not in line
    return line


def flip(file: Path, offset: int) -> None:
    content = bytearray(file.read_bytes())
    content[offset] ^= 1
    file.write_bytes(bytes(content))
