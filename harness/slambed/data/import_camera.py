# SPDX-License-Identifier: Apache-2.0
"""Converts calibrations of other tools to the `camera` of a dataset file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slambed.data.camera_files import CalibratedCamera, Floats, read_cameras
from slambed.data.model import beside_picture, implausible
from slambed.data.recipe import CameraRecipe
from slambed.errors import SlambedError
from slambed.files.yaml_source import MisplacedError

BESIDE = 0.95
"""Least share of the distance to the next camera that lies along x, for a stereo pair."""


def camera_yaml(file: Path, number: int, baseline_m: float | None) -> tuple[str, list[str]]:
    """Returns the lines for a dataset file, and remarks on them."""
    kind, cameras = read_cameras(file)
    if number >= len(cameras):
        raise SlambedError(
            f"{file}: {kind} with {len(cameras)} camera(s), there is no camera {number}; "
            f"choose 0 to {len(cameras) - 1}"
        )
    camera = cameras[number]
    notes = [f"{file} is {kind}", *camera.remarks]
    bf = camera.bf if baseline_m is None else baseline_m * float(camera.lens.matrix[0, 0])
    if bf is None and (place := _place_of_next(cameras, number)) is not None:
        distance_m = float(np.linalg.norm(place))
        bf = float(camera.lens.matrix[0, 0]) * distance_m
        notes += _of_rig(number + 1, place, distance_m)
    if bf is None:
        bf = 0.0
    if bf == 0:
        notes.append("bf is 0, as for one camera; of stereo and depth say --baseline-m")
    fx, cx, cy = (float(camera.lens.matrix[place]) for place in ((0, 0), (0, 2), (1, 2)))
    if wrong := implausible(cx, cy, bf / fx, camera.size):
        raise SlambedError(f"{file}: {wrong}; calibrate again, or say --baseline-m")
    recipe = _recipe(camera, bf)
    try:
        recipe.must_be_real()
    except MisplacedError as unreal:
        raise SlambedError(f"{file}: {'.'.join(map(str, unreal.location))}: {unreal}") from None
    if beside := beside_picture(cx, cy, camera.size):
        notes.append(beside)
    return _text(recipe), notes


def _place_of_next(cameras: list[CalibratedCamera], number: int) -> Floats | None:
    """Returns where the next camera of a camchain is, [3] m in this camera's coordinates."""
    if number + 1 >= len(cameras) or (motion := cameras[number + 1].pose) is None:
        return None
    return np.asarray(-motion[:3, :3].T @ motion[:3, 3])


def _of_rig(following: int, place: Floats, distance_m: float) -> list[str]:
    """Returns remarks on two cameras that are not the left and the right one of a stereo pair."""
    right_m = float(place[0])
    if abs(right_m) < BESIDE * distance_m:
        x, y, z = place
        return [
            f"cam{following} is not beside this camera but at x {x:.3f}, y {y:.3f}, z {z:.3f} m; "
            "as a stereo pair they must be rectified"
        ]
    if right_m < 0:
        return [
            f"cam{following} is {distance_m:.3f} m to the left of this camera: as a stereo pair "
            "its pictures are the left ones"
        ]
    return []


def _recipe(camera: CalibratedCamera, bf: float) -> CameraRecipe:
    (fx, _, cx), (_, fy, cy) = camera.lens.matrix[:2].tolist()
    width, height = camera.size
    return CameraRecipe(
        width=width,
        height=height,
        fx=fx,
        fy=fy,
        cx=cx,
        cy=cy,
        bf=bf,
        distortion=tuple(camera.lens.coefficients.tolist()),
        distortion_model=camera.lens.model,
    )


def _text(camera: CameraRecipe) -> str:
    lines = [
        "camera:",
        f"  {{ width: {camera.width}, height: {camera.height}, fx: {camera.fx!r}, "
        f"fy: {camera.fy!r}, cx: {camera.cx!r}, cy: {camera.cy!r}, bf: {camera.bf:.9g},",
        f"    distortion: {list(camera.distortion)}",
    ]
    if camera.distortion_model != CameraRecipe.model_fields["distortion_model"].default:
        lines[-1] += f", distortion_model: {camera.distortion_model}"
    return "\n".join(lines) + " }"
