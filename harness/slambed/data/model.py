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


@dataclass(frozen=True)
class Frame:
    """One frame of a sequence: absolute recorded time and two images (second: None for mono)."""

    timestamp_ns: int
    gray: GrayImage
    second: SecondImage | None
