# SPDX-License-Identifier: Apache-2.0
"""Writes a PNG of some frames of a sequence, side by side."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from slambed.data.prepared import PreparedSequence
from slambed.errors import SlambedError
from slambed.files.atomic import replacing
from slambed.files.outputs import writing

TILE_WIDTH_PX = 320
Picture = NDArray[np.uint8]


def write_sheet(
    sequence: PreparedSequence,
    tile: Callable[[int], Picture],
    file: Path,
    frames: int,
    columns: int,
) -> None:
    """Writes evenly spaced frames, `columns` per row; `tile` returns the image of a frame."""
    chosen = np.unique(np.linspace(0, len(sequence) - 1, frames).astype(int))
    tiles = [tile(int(i)) for i in chosen]
    while len(tiles) % columns:
        tiles.append(np.zeros_like(tiles[0]))
    rows = [np.hstack(tiles[i : i + columns]) for i in range(0, len(tiles), columns)]
    done, png = cv2.imencode(".png", np.vstack(rows))
    if not done:
        raise SlambedError(f"{file}: the picture could not be encoded")
    with writing(file), replacing(file) as partial:  # a full disk leaves no empty file
        partial.write_bytes(png.tobytes())


def colors_of(gray: NDArray[np.uint8]) -> Picture:
    """Converts gray to BGR."""
    return np.asarray(cv2.cvtColor(np.asarray(gray), cv2.COLOR_GRAY2BGR), np.uint8)


def shrunk(picture: Picture) -> Picture:
    """Scales to the width of a tile."""
    scale = TILE_WIDTH_PX / picture.shape[1]
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.uint8)


def label(tile: Picture, sequence: PreparedSequence, frame: int, more: str = "") -> None:
    """Writes time and number of the frame into the tile's corner."""
    text = f"{sequence.times_s[frame]:.2f} s  #{frame}{more}"
    cv2.putText(tile, text, (5, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1)
