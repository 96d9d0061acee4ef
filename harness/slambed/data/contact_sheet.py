# SPDX-License-Identifier: Apache-2.0
"""A picture of a sequence: some frames, grey beside depth (or right image)."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from slambed.data.prepared import PreparedSequence
from slambed.errors import SlambedError
from slambed.outputs import writing

_TILE_WIDTH_PX = 320
_FARTHEST_SHOWN_M = 6.0


def write_contact_sheet(sequence: PreparedSequence, file: Path, frames: int = 12) -> None:
    """Writes a PNG with evenly spaced frames, three pairs a row, each with its time."""
    chosen = np.unique(np.linspace(0, len(sequence) - 1, frames).astype(int))
    tiles = [_tile(sequence, int(i)) for i in chosen]
    while len(tiles) % 3:
        tiles.append(np.zeros_like(tiles[0]))
    rows = [np.hstack(tiles[i : i + 3]) for i in range(0, len(tiles), 3)]
    ok, png = cv2.imencode(".png", np.vstack(rows))
    if not ok:
        raise SlambedError(f"{file}: the picture could not be encoded")
    with writing(file):
        file.write_bytes(png.tobytes())


def _tile(sequence: PreparedSequence, i: int) -> NDArray[np.uint8]:
    planes = [cv2.cvtColor(np.asarray(sequence.grey(i)), cv2.COLOR_GRAY2BGR)]
    second = sequence.second(i)
    if second is not None:
        planes.append(_colour(second, sequence.info.depth_unit_m))
    scale = _TILE_WIDTH_PX / sequence.info.width
    small = [cv2.resize(p, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) for p in planes]
    tile = np.hstack(small)
    text = f"{sequence.times_s[i]:.2f} s  #{i}"
    tile[:20, :130] = tile[:20, :130] // 3  # a darker ground for the text
    cv2.putText(tile, text, (5, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1)
    return np.asarray(tile, dtype=np.uint8)


def _colour(plane: NDArray[np.uint8] | NDArray[np.uint16], unit_m: float) -> NDArray[np.uint8]:
    if plane.dtype == np.uint8:
        return np.asarray(cv2.cvtColor(np.asarray(plane), cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    metres = plane.astype(np.float32) * unit_m
    level = np.clip(metres / _FARTHEST_SHOWN_M * 255, 0, 255).astype(np.uint8)
    image = np.asarray(cv2.applyColorMap(level, cv2.COLORMAP_TURBO), dtype=np.uint8)
    image[plane == 0] = 0
    return image
