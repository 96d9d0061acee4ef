# SPDX-License-Identifier: Apache-2.0
"""Basic types of a sequence: camera and frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

Sensor = Literal["rgbd", "stereo", "mono"]
GrayImage = NDArray[np.uint8]
#: Right gray image (stereo) or raw depth in units of the sensor (rgbd).
SecondImage = NDArray[np.uint8] | NDArray[np.uint16]


LARGEST_SIDE = 65_535
"""Of a picture, in pixels."""


class Camera(BaseModel):
    """Pinhole camera with OpenCV's radial-tangential distortion; bf is fx times baseline (px m)."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    fx: float = Field(gt=0)
    fy: float = Field(gt=0)
    cx: float
    cy: float
    bf: float = Field(ge=0)
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)


LONGEST_BASELINE_M = 20.0
"""Of a rig; a longer one is in millimeters."""


FARTHEST_OUTSIDE = 2
"""Of a principal point, in pictures beside its own: pictures are cut from larger ones, and a
calibration in other units than pixels is hundreds of pictures outside."""


def implausible(cx: float, cy: float, baseline_m: float, size: tuple[int, int]) -> str:
    """Returns what no camera has: a principal point more than two pictures outside of its own, or
    a baseline below 0 or above 20 m; empty if all is plausible."""
    if outside := _outside(cx, cy, size, FARTHEST_OUTSIDE):
        return f"{outside} is far outside of a picture of {size[0]}x{size[1]}"
    if baseline_m < 0:
        return f"a baseline of {baseline_m:g} m, expected 0 or more; are left and right swapped?"
    if not baseline_m <= LONGEST_BASELINE_M:
        return f"a baseline of {baseline_m:g} m, expected 0 to {LONGEST_BASELINE_M:g}; is it in mm?"
    return ""


def beside_picture(cx: float, cy: float, size: tuple[int, int]) -> str:
    """Returns a remark on a principal point outside of its picture; empty if it is inside."""
    if not (outside := _outside(cx, cy, size, 0)):
        return ""
    return (
        f"{outside} is outside of a picture of {size[0]}x{size[1]}: right only if it was cut from "
        "a larger one"
    )


def _outside(cx: float, cy: float, size: tuple[int, int], pictures: int) -> str:
    """Returns `cx 900`, the first coordinate that is more than so many pictures outside of its own,
    or not a number; empty if none is."""
    for name, value, side in (("cx", cx, size[0]), ("cy", cy, size[1])):
        if not -pictures * side <= value <= (1 + pictures) * side:
            return f"{name} {value:g}"
    return ""


@dataclass(frozen=True)
class Frame:
    """One frame of a sequence: absolute recorded time and two images (second: None for mono)."""

    timestamp_ns: int
    gray: GrayImage
    second: SecondImage | None
