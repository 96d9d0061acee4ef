# SPDX-License-Identifier: Apache-2.0
"""Folder layouts that other programs read, and the sensors they support."""

from typing import Literal

Layout = Literal["tum", "euroc", "kitti"]

SENSORS: dict[str, tuple[str, ...]] = {
    "tum": ("rgbd",),
    "euroc": ("stereo",),
    "kitti": ("stereo", "mono"),
}
"""Layout -> supported sensors."""
