# SPDX-License-Identifier: Apache-2.0
"""The mask cache (docs/reference/sequence.md): a network's instances in every frame of a sequence.
The generator's labels.bin has the same format."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

from slambed.segment.frame_file import MASKS, FrameFile, damaged
from slambed.segment.instances import KEYPOINTS, Instance, Segmented, mask_of, runs_of

LABELS_FILE = "labels.bin"
LABELS_KEY = "labels"
MOST_INSTANCES = 100
_BLOCK = struct.Struct("<IIII")
_INSTANCE = struct.Struct("<HHfI")
_MOVES, _HAS_KEYPOINTS = 1, 2
_POINT = np.dtype([("u", "<f4"), ("v", "<f4"), ("visibility", "<u4")])


class MaskCache:
    """A mask cache in memory; frames are decoded on access."""

    def __init__(self, file: FrameFile) -> None:
        self._file = file

    @classmethod
    def open(cls, path: Path, key: str | None = None) -> MaskCache:
        """Reads a whole file. Raises SlambedError if it was made for another key."""
        return cls(FrameFile.open(path, MASKS, key))

    def __len__(self) -> int:
        return len(self._file)

    @property
    def key(self) -> str:
        """Returns the key that it was made for."""
        return self._file.key

    def frame(self, i: int) -> Segmented:
        try:
            return decode_frame(self._file.block(i))
        except (ValueError, struct.error) as wrong:
            raise damaged(self._file.path, f"frame {i}: {wrong}") from wrong


def decode_frame(block: bytes) -> Segmented:
    """Decodes one frame's block. Raises ValueError if it is damaged."""
    count, crc, width, height = _BLOCK.unpack_from(block)
    if zlib.crc32(block[8:]) != crc:
        raise ValueError("does not fit its CRC")
    if count > MOST_INSTANCES or not 0 < width * height <= 1 << 28:
        raise ValueError(f"{count} instances in {width}x{height} pixels")
    at, found = _BLOCK.size, []
    for _ in range(count):
        class_index, flags, score, runs_count = _INSTANCE.unpack_from(block, at)
        at += _INSTANCE.size
        if flags > 3 or not 0 <= score <= 1:
            raise ValueError(f"flags {flags}, score {score}")
        keypoints = None
        if flags & _HAS_KEYPOINTS:
            points = np.frombuffer(block, _POINT, KEYPOINTS, at)
            keypoints = np.stack(
                [points["u"], points["v"], points["visibility"].astype(np.float32)], axis=1
            )
            if not np.isfinite(keypoints).all() or points["visibility"].max() > 2:
                raise ValueError("key points that are no numbers")
            at += KEYPOINTS * _POINT.itemsize
        runs = np.frombuffer(block, "<u4", runs_count, at)
        at += 4 * runs_count
        if (
            runs_count == 0
            or int(runs.sum(dtype=np.uint64)) != width * height
            or not runs[1:].all()
        ):
            raise ValueError("runs that do not add up to the picture")
        mask = mask_of(runs, width, height)
        found.append(Instance(class_index, score, mask, bool(flags & _MOVES), keypoints))
    if at != len(block):
        raise ValueError(f"{len(block) - at} bytes left over")
    return Segmented(width, height, tuple(found))


def encode_frame(picture: Segmented) -> bytes:
    """Encodes one frame, with at most MOST_INSTANCES in descending score."""
    best = sorted(picture.instances, key=lambda instance: -instance.score)[:MOST_INSTANCES]
    body = struct.pack("<II", picture.width, picture.height)
    for instance in best:
        runs = runs_of(instance.mask)
        has_points = instance.keypoints is not None
        flags = (_MOVES if instance.moves else 0) | (_HAS_KEYPOINTS if has_points else 0)
        body += _INSTANCE.pack(instance.class_index, flags, instance.score, len(runs))
        if instance.keypoints is not None:
            points = np.zeros(KEYPOINTS, _POINT)
            points["u"], points["v"], points["visibility"] = instance.keypoints.T
            body += points.tobytes()
        body += runs.astype("<u4").tobytes()
    return struct.pack("<II", len(best), zlib.crc32(body)) + body
