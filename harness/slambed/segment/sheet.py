# SPDX-License-Identifier: Apache-2.0
"""Draws a contact sheet: some frames of a sequence with their masks."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from slambed.data.picture_sheet import Picture, colors_of, label, shrunk, write_sheet
from slambed.data.prepared import PreparedSequence
from slambed.segment.instances import Segmented
from slambed.segment.mask_cache import MaskCache

_COLUMNS = 4
_COLORS = ((60, 60, 230), (60, 200, 60), (230, 120, 40), (40, 200, 230), (220, 60, 220))


def write_mask_sheet(sequence: PreparedSequence, masks: MaskCache, file: Path, frames: int) -> None:
    """Writes a PNG with evenly spaced frames, four per row."""
    write_sheet(sequence, lambda i: _tile(sequence, masks.frame(i), i), file, frames, _COLUMNS)


def _tile(sequence: PreparedSequence, found: Segmented, i: int) -> Picture:
    tile = colors_of(sequence.gray(i))
    for number, instance in enumerate(found.instances):
        color = np.array(_COLORS[number % len(_COLORS)])
        tile[instance.mask] = (0.6 * tile[instance.mask] + 0.4 * color).astype(np.uint8)
        for u, v, seen in instance.keypoints if instance.keypoints is not None else ():
            if seen > 0:
                dot = (255, 255, 0) if seen == 2 else (255, 0, 255)
                cv2.circle(tile, (round(float(u)), round(float(v))), 4, dot, -1)
    small = shrunk(tile)
    label(small, sequence, i, f"  {100 * found.moving().mean():.0f} %")
    return small
