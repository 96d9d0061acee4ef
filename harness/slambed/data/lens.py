# SPDX-License-Identifier: Apache-2.0
"""Lens distortion models that OpenCV can undistort, and their names in other tools."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slambed.errors import SlambedError

Floats = NDArray[np.float64]
Model = Literal["radial-tangential", "equidistant"]

#: Names of ROS, Kalibr, EuRoC, Basalt and OpenCV.
_NAMES: dict[str, Model] = {
    "radial-tangential": "radial-tangential",
    "radtan": "radial-tangential",
    "plumb_bob": "radial-tangential",
    "rational_polynomial": "radial-tangential",
    "brown_conrady": "radial-tangential",
    "none": "radial-tangential",
    "equidistant": "equidistant",
    "equi": "equidistant",
    "fisheye": "equidistant",
    "kannala_brandt": "equidistant",
    "kannala_brandt4": "equidistant",
    "kb4": "equidistant",
}
_COUNTS: dict[Model, tuple[int, ...]] = {
    "radial-tangential": (4, 5, 8, 12, 14),
    "equidistant": (4,),
}
_ORDERS: dict[Model, str] = {
    "radial-tangential": "k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]]",
    "equidistant": "k1 k2 k3 k4",
}
#: Skew of a camera matrix that is none; the cameras here have no skew.
LARGEST_SKEW_PX = 0.01
#: Coefficients that a node undistorts itself: k1 k2 p1 p2 k3.
PLAIN_COUNT = 5


def model_of(name: str, where: str) -> Model:
    """Returns the model with this name. Raises SlambedError for an unsupported model."""
    known = _NAMES.get(name.strip().lower().replace(" ", "_"))
    if known is None:
        raise SlambedError(
            f"{where}: distortion model '{name}' is not supported (FOV, omni, double sphere and "
            "the like are not); calibrate as radial-tangential (radtan, plumb_bob) or equidistant, "
            "or undistort the pictures before"
        )
    return known


def coefficients_of(values: Sequence[float], model: Model, where: str) -> Floats:
    """Checks the number of coefficients; an empty list means no distortion."""
    if not values:
        return np.zeros(4)
    if len(values) not in _COUNTS[model]:
        counts = ", ".join(str(count) for count in _COUNTS[model])
        raise SlambedError(
            f"{where}: {len(values)} numbers of {model} distortion; expected {counts}: "
            f"{_ORDERS[model]}"
        )
    found = np.array(values, dtype=np.float64)
    if not np.isfinite(found).all():
        raise SlambedError(f"{where}: a number of the distortion is not finite; calibrate again")
    return found


@dataclass(frozen=True)
class Lens:
    """Camera matrix [3,3] and distortion of one camera."""

    matrix: Floats
    coefficients: Floats
    model: Model

    def maps(
        self, rotation: Floats, projection: Floats, size: tuple[int, int]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Returns the source position of each pixel in the undistorted image."""
        import cv2  # slow to import, and not needed to list datasets

        own = (self.matrix, self.coefficients, rotation, projection, size, cv2.CV_32FC1)
        fisheye = self.model == "equidistant"
        make = cv2.fisheye.initUndistortRectifyMap if fisheye else cv2.initUndistortRectifyMap
        x, y = make(*own)
        return np.asarray(x, np.float32), np.asarray(y, np.float32)


def rectified(
    left: Lens, right: Lens, size: tuple[int, int], rotation: Floats, translation_m: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Returns rotations and projections [3,4] of both rectified cameras, given the pose of the
    right camera relative to the left one."""
    import cv2

    arguments = (
        left.matrix, left.coefficients, right.matrix, right.coefficients, size, rotation,
        translation_m,
    )  # fmt: skip
    if left.model != right.model:
        raise SlambedError("cam0 and cam1 have different distortion models; calibrate them alike")
    flags = cv2.CALIB_ZERO_DISPARITY
    found: Sequence[object]
    if left.model == "equidistant":
        found = cv2.fisheye.stereoRectify(*arguments, flags=flags)
    else:
        found = cv2.stereoRectify(*arguments, flags=flags, alpha=0)
    r0, r1, p0, p1 = (np.asarray(matrix, np.float64) for matrix in found[:4])
    return r0, r1, p0, p1
