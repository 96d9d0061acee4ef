# SPDX-License-Identifier: Apache-2.0
"""Decodes images and depth of ROS messages: Image and CompressedImage."""

from __future__ import annotations

import struct
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from slambed.data.images import GRAY, GrayRange, decode, eight_bits
from slambed.data.model import GrayImage
from slambed.errors import SlambedError

#: Header of compressed_depth_image_transport before the PNG: a format, and A and B of the
#: quantization, inverse depth = A / depth + B.
_DEPTH_HEADER = struct.Struct("<iff")
#: Beyond the range of any depth camera: such values are millimeters.
_FARTHEST_M = 100.0
#: Depth is kept in 16 bits; what is farther counts as not measured, unless it is more than this
#: share of a picture.
_STEPS, _LOST_SHARE = 65_535, 0.1
_LAYOUTS: dict[str, tuple[str, int]] = {
    "mono8": ("u1", 1), "8UC1": ("u1", 1), "rgb8": ("u1", 3), "bgr8": ("u1", 3),
    "8UC3": ("u1", 3), "rgba8": ("u1", 4), "bgra8": ("u1", 4),
    "mono16": ("u2", 1), "16UC1": ("u2", 1), "32FC1": ("f4", 1),
}  # fmt: skip


def gray_of(message: Any, name: str, gray_range: GrayRange | None) -> GrayImage:
    """Returns the 8-bit gray image of a message."""
    if hasattr(message, "format"):
        return eight_bits(decode(message.data.tobytes(), GRAY, name), gray_range, name)
    image, encoding = _pixels(message, name)
    if image.dtype.kind == "f" or (encoding == "16UC1" and gray_range is None):
        raise SlambedError(f"{name}: {encoding} is not a gray or color image; swap the topics?")
    if image.ndim == 2:
        return eight_bits(image, gray_range, name)
    order = "RGB" if encoding.startswith("rgb") else "BGR"
    code = getattr(cv2, f"COLOR_{order}{'A' if image.shape[2] == 4 else ''}2GRAY")
    return eight_bits(cv2.cvtColor(image, code).astype(np.uint8), gray_range, name)


def depth_of(message: Any, name: str, unit_m: float) -> NDArray[np.uint16]:
    """Returns raw depth in steps of the unit: meters are converted, integers are used unchanged."""
    if not hasattr(message, "format"):
        image, _ = _pixels(message, name)
    elif "compresseddepth" in str(message.format).lower():
        image = _compressed_depth(message, name)
    else:
        image = decode(message.data.tobytes(), cv2.IMREAD_UNCHANGED, name)
    if image.dtype.kind == "f":
        return _steps(image, name, unit_m)
    if image.dtype.itemsize != 2 or image.ndim != 2:
        raise SlambedError(f"{name}: depth must be 16UC1, mono16 or 32FC1; swap the topics?")
    return image.astype(np.uint16)


def _compressed_depth(message: Any, name: str) -> NDArray[Any]:
    """Decodes compressed_depth_image_transport: `16UC1; compressedDepth` is the depth itself,
    `32FC1; compressedDepth` its quantized inverse."""
    reported, data = str(message.format), message.data.tobytes()
    encoding = reported.partition(";")[0].strip()
    if "rvl" in reported.lower():
        raise SlambedError(
            f"{name}: '{reported}': RVL compression is not supported; republish it as png or raw "
            "(ros2 run image_transport republish compressedDepth raw)"
        )
    if encoding not in ("16UC1", "mono16", "32FC1"):
        raise SlambedError(
            f"{name}: '{reported}' does not say what the depth was, expected "
            "'16UC1; compressedDepth' or '32FC1; compressedDepth'; republish it raw"
        )
    if len(data) < _DEPTH_HEADER.size:
        raise SlambedError(f"{name}: {len(data)} bytes are no compressed depth; record it again")
    image = decode(data[_DEPTH_HEADER.size :], cv2.IMREAD_UNCHANGED, name)
    if encoding != "32FC1":
        return image
    _, a, b = _DEPTH_HEADER.unpack_from(data)
    if image.dtype != np.uint16 or image.ndim != 2 or not (a > 0 and np.isfinite(b)):
        raise SlambedError(f"{name}: '{reported}' is not quantized as expected; republish it raw")
    known = (image > 0) & (image > b)
    inverse = np.where(known, image.astype(np.float64) - b, 1.0)
    return np.where(known, a / inverse, np.nan)


def _steps(meters: NDArray[Any], name: str, unit_m: float) -> NDArray[np.uint16]:
    meters = np.asarray(meters, dtype=np.float64)
    finite = meters[np.isfinite(meters) & (meters > 0)]
    if finite.size and float(np.median(finite)) > _FARTHEST_M:
        raise SlambedError(
            f"{name}: depth as 32FC1 is in meters, the largest value is {finite.max():g} and the "
            f"median {np.median(finite):g}; are they millimeters? Convert the topic to meters"
        )
    steps = np.nan_to_num(meters, nan=0.0, posinf=0.0, neginf=0.0) / unit_m
    if np.count_nonzero(steps >= _STEPS) > _LOST_SHARE * finite.size:
        raise SlambedError(
            f"{name}: depth up to {finite.max():g} m does not fit into {_STEPS} steps of "
            f"depth_unit_m {unit_m:g}; take a larger unit"
        )
    return np.where((steps > 0) & (steps < _STEPS), np.rint(steps), 0).astype(np.uint16)


def _pixels(message: Any, name: str) -> tuple[NDArray[Any], str]:
    """Returns the image as an array, and its encoding; rows may be padded."""
    if message.encoding not in _LAYOUTS:
        raise SlambedError(
            f"{name}: encoding '{message.encoding}' is not known; known: {', '.join(_LAYOUTS)}; "
            "convert the bag"
        )
    kind, channels = _LAYOUTS[message.encoding]
    dtype = np.dtype((">" if message.is_bigendian else "<") + kind)
    data = np.frombuffer(message.data.tobytes(), np.uint8)
    width_bytes = message.width * channels * dtype.itemsize
    if not 0 < width_bytes <= message.step:
        raise SlambedError(
            f"{name}: rows of {message.width} pixels in {message.encoding} need {width_bytes} "
            f"bytes, the message says step {message.step}; record it again"
        )
    if data.size < message.height * message.step:
        raise SlambedError(f"{name}: an image is shorter than its header says; record it again")
    rows = data[: message.height * message.step].reshape(message.height, message.step)
    image = np.ascontiguousarray(rows[:, :width_bytes]).view(dtype)
    shape = (message.height, message.width) + ((channels,) if channels > 1 else ())
    return image.reshape(shape), str(message.encoding)
