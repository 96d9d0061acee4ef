# SPDX-License-Identifier: Apache-2.0
"""An overview image of a sequence: some frames, gray next to depth (or the right image)."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from slambed.data.model import SecondImage
from slambed.data.picture_sheet import Picture, colors_of, label, shrunk, write_sheet
from slambed.data.prepared import PreparedSequence

_COLUMNS = 3
_FARTHEST_SHOWN_M = 6.0


def write_contact_sheet(sequence: PreparedSequence, file: Path, frames: int = 12) -> None:
    """Writes a PNG of evenly spaced frames, three pairs per row, each labeled with its time."""
    write_sheet(sequence, lambda i: _tile(sequence, i), file, frames, _COLUMNS)


def _tile(sequence: PreparedSequence, i: int) -> Picture:
    planes = [colors_of(sequence.gray(i))]
    second = sequence.second(i)
    if second is not None:
        planes.append(_color(second, sequence.info.depth_unit_m))
    tile = np.hstack([shrunk(plane) for plane in planes])
    tile[:20, :130] = tile[:20, :130] // 3  # a darker background for the text
    label(tile, sequence, i)
    return tile


def _color(plane: SecondImage, unit_m: float) -> Picture:
    if plane.dtype == np.uint8:
        return colors_of(plane.astype(np.uint8, copy=False))
    meters = plane.astype(np.float32) * unit_m
    level = np.clip(meters / _FARTHEST_SHOWN_M * 255, 0, 255).astype(np.uint8)
    image = np.asarray(cv2.applyColorMap(level, cv2.COLORMAP_TURBO), dtype=np.uint8)
    image[plane == 0] = 0
    return image
