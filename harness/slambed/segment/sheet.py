# SPDX-License-Identifier: Apache-2.0
"""A picture of masks: some frames of a sequence with what was found in them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from slambed.data.prepared import PreparedSequence
from slambed.errors import SlambedError
from slambed.outputs import writing
from slambed.segment.instances import Segmented
from slambed.segment.mask_cache import MaskCache

_TILE_WIDTH_PX = 320
_COLOURS = ((60, 60, 230), (60, 200, 60), (230, 120, 40), (40, 200, 230), (220, 60, 220))


def write_sheet(sequence: PreparedSequence, masks: MaskCache, file: Path, frames: int) -> None:
    """Writes a PNG with evenly spaced frames, four a row."""
    chosen = np.unique(np.linspace(0, len(sequence) - 1, frames).astype(int))
    tiles = [_tile(sequence, masks.frame(int(i)), int(i)) for i in chosen]
    while len(tiles) % 4:
        tiles.append(np.zeros_like(tiles[0]))
    rows = [np.hstack(tiles[i : i + 4]) for i in range(0, len(tiles), 4)]
    done, png = cv2.imencode(".png", np.vstack(rows))
    if not done:
        raise SlambedError(f"{file}: the picture could not be encoded")
    with writing(file):
        file.write_bytes(png.tobytes())


def _tile(sequence: PreparedSequence, found: Segmented, i: int) -> NDArray[np.uint8]:
    tile = np.asarray(cv2.cvtColor(np.asarray(sequence.grey(i)), cv2.COLOR_GRAY2BGR), np.uint8)
    for number, instance in enumerate(found.instances):
        colour = np.array(_COLOURS[number % len(_COLOURS)])
        tile[instance.mask] = (0.6 * tile[instance.mask] + 0.4 * colour).astype(np.uint8)
        for u, v, seen in instance.keypoints if instance.keypoints is not None else ():
            if seen > 0:
                dot = (255, 255, 0) if seen == 2 else (255, 0, 255)
                cv2.circle(tile, (round(float(u)), round(float(v))), 4, dot, -1)
    scale = _TILE_WIDTH_PX / sequence.info.width
    small = cv2.resize(tile, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    told = f"{sequence.times_s[i]:.2f} s  #{i}  {100 * found.moving().mean():.0f} %"
    cv2.putText(small, told, (5, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1)
    return np.asarray(small, dtype=np.uint8)
