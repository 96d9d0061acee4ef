# SPDX-License-Identifier: Apache-2.0
"""Layouts of a recorded folder that other programs read, and what each can hold."""

from typing import Literal

Layout = Literal["tum", "euroc", "kitti"]

SENSORS: dict[str, tuple[str, ...]] = {
    "tum": ("rgbd",),
    "euroc": ("stereo",),
    "kitti": ("stereo", "mono"),
}
"""Layout -> sensors whose sequences it can hold."""
