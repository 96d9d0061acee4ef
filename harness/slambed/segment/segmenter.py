# SPDX-License-Identifier: Apache-2.0
"""Runs a network: JPEG in, instances out. It uses one thread, so that masks are the same
everywhere."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from slambed.errors import SlambedError
from slambed.segment.instances import Instance, Segmented
from slambed.segment.network import Network, network_file
from slambed.segment.people import LEAST_SHARE, MASK_LEVEL, persons

SEGMENT_VERSION = 1
"""Incremented when the same network and image give different masks."""


class Segmenter:
    """A loaded network."""

    def __init__(self, network: Network, file: Path | None = None) -> None:
        """Loads the network; `file` replaces the one in its YAML and is not checked."""
        cv2.setNumThreads(1)
        self.network = network
        path = file or network_file(network)
        try:
            if path.suffix == ".onnx":
                self._net = cv2.dnn.readNetFromONNX(str(path))
            else:
                buffer = np.frombuffer(path.read_bytes(), np.uint8)
                self._net = cv2.dnn.readNetFromTFLite(buffer)
            self._net.setPreferableBackend(cv2.dnn.DNN_BACKEND_OPENCV)
            names = tuple(self._net.getUnconnectedOutLayersNames())
        except cv2.error as refused:
            raise SlambedError(f"{path}: no network that can be read ({refused.err})") from refused
        if network.decoder == "people" and set(names) != set(network.outputs):
            raise SlambedError(
                f"{path}: gives {', '.join(names)}, not {', '.join(network.outputs)}"
            )

    def segment(self, jpeg: bytes, n_m: float) -> Segmented:
        """Returns the instances in a gray JPEG. n_m: overlap (0 to 1) above which two instances are
        one."""
        if not 0 <= n_m <= 1:
            raise SlambedError(f"n_m is {n_m}, not within 0 to 1")
        gray = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE) if jpeg else None
        if gray is None:
            raise SlambedError(f"a picture of {len(jpeg)} bytes cannot be decoded as JPEG")
        return self.segment_gray(np.asarray(gray, dtype=np.uint8), n_m)

    def segment_gray(self, gray: NDArray[np.uint8], n_m: float) -> Segmented:
        """Returns the instances in a decoded image."""
        height, width = gray.shape
        size = (self.network.input.width, self.network.input.height)
        small = cv2.resize(gray, size, interpolation=cv2.INTER_AREA).astype(np.float32) / 255
        blob = np.repeat(small[None, None], self.network.input.planes, axis=1)
        self._net.setInput(blob)
        if self.network.decoder == "people":
            outputs = dict(
                zip(
                    self.network.outputs, self._net.forward(list(self.network.outputs)), strict=True
                )
            )
            mask, maps = outputs["mask"], outputs["maps"]
            if not (np.isfinite(mask).all() and np.isfinite(maps).all()):
                raise SlambedError(f"network {self.network.id} gave what is no number")
            return persons(mask[0, 0], maps[0], width, height, n_m)
        return _selfie(np.asarray(self._net.forward()), width, height)


def _selfie(output: NDArray[np.float32], width: int, height: int) -> Segmented:
    """Returns one mask for all people without keypoints; n_m does not apply."""
    plane = np.squeeze(output)
    if plane.ndim != 2 or not np.isfinite(plane).all():
        raise SlambedError(f"the network gave {output.shape}, not one plane of numbers")
    shown = cv2.resize(plane, (width, height), interpolation=cv2.INTER_LINEAR)
    here = shown > MASK_LEVEL
    if here.mean() < LEAST_SHARE:
        return Segmented(width, height)
    score = float(np.clip(shown[here].mean(), 0, 1))
    return Segmented(width, height, (Instance(0, score, here, True),))
