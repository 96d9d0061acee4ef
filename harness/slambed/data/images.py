# SPDX-License-Identifier: Apache-2.0
"""Reads image files; every possible error is reported in one clear line."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from slambed.data.encoded_picture import check_picture
from slambed.data.model import GrayImage
from slambed.errors import SlambedError

#: Pixels in sensor orientation: calibrations do not consider EXIF orientation. Images of 16 bits
#: are not silently reduced to 8.
GRAY = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
GrayRange = tuple[float, float]


def read_gray(
    path: Path, size: tuple[int, int] | None = None, gray_range: GrayRange | None = None
) -> GrayImage:
    """Reads an 8-bit gray image; `size` is its required (width, height)."""
    image = eight_bits(decode(_bytes(path), GRAY, str(path)), gray_range, str(path))
    if size is not None and _size_of(image) != size:
        raise SlambedError(
            f"{path}: {_in_pixels(image)} pixels, not {size[0]}x{size[1]}; "
            "correct width and height of the dataset's camera"
        )
    return image


def eight_bits(
    image: NDArray[np.uint8] | NDArray[np.uint16], gray_range: GrayRange | None, name: str
) -> GrayImage:
    """Scales more than 8 bits by a range that is the same for all images: with an automatic
    range per image, the same surface would change its brightness."""
    if image.dtype == np.uint8 and gray_range is None:
        return image.astype(np.uint8, copy=False)
    if gray_range is None:
        raise SlambedError(
            f"{name}: a picture of {8 * image.dtype.itemsize} bits with values {image.min()} to "
            f"{image.max()}, 8 are expected; say 'reader_options: {{gray_range: [LOW, HIGH]}}' for "
            "what becomes 0 and 255 in all pictures"
        )
    low, high = gray_range
    scaled = (image.astype(np.float64) - low) * (255 / (high - low))
    return np.clip(np.rint(scaled), 0, 255).astype(np.uint8)


def read_depth(path: Path, size: tuple[int, int] | None = None) -> NDArray[np.uint16]:
    """Reads raw 16-bit depth from a PNG file."""
    image = decode(_bytes(path), cv2.IMREAD_UNCHANGED, str(path))
    if image.dtype != np.uint16 or image.ndim != 2:
        raise SlambedError(
            f"{path}: depth must be a 16-bit one-channel PNG, this is {image.dtype} with "
            f"{1 if image.ndim == 2 else image.shape[2]} channel(s); export the raw depth"
        )
    if size is not None and _size_of(image) != size:
        raise other_size(str(path), "depth", _size_of(image), size)
    return image.astype(np.uint16, copy=False)


def other_size(
    name: str, what: str, found: tuple[int, int], first: tuple[int, int]
) -> SlambedError:
    """Returns the error for a second image with a different size than the first."""
    advice = (
        "align depth to color when recording (align_depth of realsense-ros, depth_registered)"
        if what == "depth"
        else "both cameras of a rig must deliver the same size"
    )
    return SlambedError(
        f"{name}: {what} of {found[0]}x{found[1]} pixels, the first camera has "
        f"{first[0]}x{first[1]}; {advice}"
    )


def decode(data: bytes, flags: int, name: str) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Decodes an image. A truncated file is an error even if the decoder would accept it;
    trailing bytes, as added by cameras and web servers, are allowed."""
    check_picture(data, name)
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags) if data else None
    except cv2.error:  # invalid image size
        image = None
    if image is None:
        raise SlambedError(f"{name}: cannot be decoded as an image; fetch the file again")
    return image  # type: ignore[return-value]


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as refused:
        raise SlambedError(f"{path}: {refused.strerror}; complete the dataset") from refused


def _size_of(image: NDArray[np.generic]) -> tuple[int, int]:
    return image.shape[1], image.shape[0]


def _in_pixels(image: NDArray[np.generic]) -> str:
    return f"{image.shape[1]}x{image.shape[0]}"
