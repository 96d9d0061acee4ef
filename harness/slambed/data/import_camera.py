# SPDX-License-Identifier: Apache-2.0
"""Converts calibrations of other tools to the `camera` of a dataset file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slambed.data.camera_files import CalibratedCamera, read_cameras
from slambed.errors import SlambedError


def camera_yaml(file: Path, number: int, baseline_m: float | None) -> tuple[str, list[str]]:
    """Returns the lines for a dataset file, and remarks on them."""
    kind, cameras = read_cameras(file)
    if number >= len(cameras):
        raise SlambedError(
            f"{file}: {kind} with {len(cameras)} camera(s), there is no camera {number}; "
            f"choose 0 to {len(cameras) - 1}"
        )
    camera = cameras[number]
    notes = [f"{file} is {kind}"]
    bf = camera.bf if baseline_m is None else baseline_m * float(camera.lens.matrix[0, 0])
    if bf is None:
        bf = _bf_of_next(cameras, number)
    if bf is None:
        bf = 0.0
        notes.append("bf is 0, as for one camera; of stereo and depth say --baseline-m")
    return _text(camera, bf), notes


def _bf_of_next(cameras: list[CalibratedCamera], number: int) -> float | None:
    """Returns fx times the distance to the next camera of a camchain."""
    if number + 1 >= len(cameras) or (motion := cameras[number + 1].pose) is None:
        return None
    distance_m = float(np.linalg.norm(motion[:3, 3]))
    return float(cameras[number].lens.matrix[0, 0]) * distance_m


def _text(camera: CalibratedCamera, bf: float) -> str:
    (fx, _, cx), (_, fy, cy) = camera.lens.matrix[:2].tolist()
    width, height = camera.size
    lines = [
        "camera:",
        f"  {{ width: {width}, height: {height}, fx: {fx!r}, fy: {fy!r}, cx: {cx!r}, cy: {cy!r}, "
        f"bf: {bf:.9g},",
        f"    distortion: {camera.lens.coefficients.tolist()}",
    ]
    if camera.lens.model != "radial-tangential":
        lines[-1] += f", distortion_model: {camera.lens.model}"
    return "\n".join(lines) + " }"
