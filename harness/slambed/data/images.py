# SPDX-License-Identifier: Apache-2.0
"""Reading image files, with one clear line for everything that can be wrong with them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from slambed.data.model import GreyImage
from slambed.errors import SlambedError

_PNG_START, _PNG_END = b"\x89PNG\r\n\x1a\n", b"IEND\xaeB`\x82"
_JPEG_START, _JPEG_END = b"\xff\xd8", b"\xff\xd9"


def read_grey(path: Path, size: tuple[int, int] | None = None) -> GreyImage:
    """8-bit grey image of a PNG or JPEG file; size: (width, height) it must have."""
    image = decode(_bytes(path), cv2.IMREAD_GRAYSCALE, str(path))
    _check_size(image, size, path)
    return image.astype(np.uint8, copy=False)


def read_depth(path: Path, size: tuple[int, int] | None = None) -> NDArray[np.uint16]:
    """Raw 16-bit depth of a PNG file."""
    image = decode(_bytes(path), cv2.IMREAD_UNCHANGED, str(path))
    if image.dtype != np.uint16 or image.ndim != 2:
        raise SlambedError(
            f"{path}: depth must be a 16-bit one-channel PNG, this is {image.dtype} with "
            f"{1 if image.ndim == 2 else image.shape[2]} channel(s); export the raw depth"
        )
    _check_size(image, size, path)
    return image.astype(np.uint16, copy=False)


def decode(data: bytes, flags: int, name: str) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Decodes an image; a cut-off file is an error even where the decoder would show a part."""
    tail = data[-64:].rstrip(b"\0")
    if data.startswith(_PNG_START) and not tail.endswith(_PNG_END):
        raise SlambedError(f"{name}: PNG is truncated ({len(data)} bytes); fetch the file again")
    if data.startswith(_JPEG_START) and not tail.endswith(_JPEG_END):
        raise SlambedError(f"{name}: JPEG is truncated ({len(data)} bytes); fetch the file again")
    image = cv2.imdecode(np.frombuffer(data, np.uint8), flags) if data else None
    if image is None:
        raise SlambedError(f"{name}: cannot be decoded as an image; fetch the file again")
    return image  # type: ignore[return-value]


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as refused:
        raise SlambedError(f"{path}: {refused.strerror}; complete the dataset") from refused


def _check_size(image: NDArray[np.generic], size: tuple[int, int] | None, path: Path) -> None:
    if size is not None and (image.shape[1], image.shape[0]) != size:
        raise SlambedError(
            f"{path}: {image.shape[1]}x{image.shape[0]} pixels, not {size[0]}x{size[1]}; "
            "correct width and height of the dataset's camera"
        )
