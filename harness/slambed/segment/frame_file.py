# SPDX-License-Identifier: Apache-2.0
"""Files with one block of bytes per frame of a sequence (docs/reference/sequence.md)."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slambed.errors import SlambedError

MASKS = b"SLMC"
_VERSION = 1
_HEAD = struct.Struct("<4sIQI")
_ALIGNMENT_BYTES = 8


class FrameFile:
    """A frame file in memory."""

    def __init__(self, path: Path, key: str, data: bytes, offsets: NDArray[np.uint64]) -> None:
        self.path, self.key, self._data, self._offsets = path, key, data, offsets

    @classmethod
    def open(cls, path: Path, magic: bytes, key: str | None = None) -> FrameFile:
        """Reads a file of this kind. Raises SlambedError if it is damaged or was made for another
        key."""
        try:
            data = path.read_bytes()
        except OSError as refused:
            raise SlambedError(f"{path}: cannot be read ({refused.strerror})") from refused
        if len(data) < _HEAD.size:
            raise damaged(path, "shorter than its head")
        own_magic, version, frames, key_bytes = _HEAD.unpack_from(data)
        if (own_magic, version) != (magic, _VERSION):
            raise damaged(path, f"does not begin with {magic.decode()} and version {_VERSION}")
        begin = _aligned(_HEAD.size + key_bytes)
        if frames > len(data) or begin + 8 * (frames + 1) > len(data):
            raise damaged(path, "shorter than its table of frames")
        own = data[_HEAD.size : _HEAD.size + key_bytes].decode("utf-8", "replace")
        if key is not None and own != key:
            raise SlambedError(f"{path}: made for '{own}', not for '{key}'; delete it")
        offsets = np.frombuffer(data, "<u8", frames + 1, begin)
        ends = [int(offsets[0]), int(offsets[-1])]
        if ends != [begin + 8 * (frames + 1), len(data)] or np.any(offsets[1:] < offsets[:-1]):
            raise damaged(path, "its table of frames does not fit its size")
        return cls(path, own, data, offsets)

    def __len__(self) -> int:
        return len(self._offsets) - 1

    def block(self, i: int) -> bytes:
        return self._data[int(self._offsets[i]) : int(self._offsets[i + 1])]


def encode_frames(magic: bytes, key: str, blocks: Sequence[bytes]) -> bytes:
    name = key.encode()
    head = _HEAD.pack(magic, _VERSION, len(blocks), len(name)) + name
    head = head.ljust(_aligned(len(head)), b"\0")
    sizes = np.array([0, *(len(block) for block in blocks)], dtype=np.uint64)
    offsets = np.cumsum(sizes) + np.uint64(len(head) + 8 * (len(blocks) + 1))
    return head + offsets.astype("<u8").tobytes() + b"".join(blocks)


def damaged(path: Path, what: str) -> SlambedError:
    return SlambedError(f"file of frames damaged: {path}: {what}; delete it and make it again")


def _aligned(size: int) -> int:
    return -(-size // _ALIGNMENT_BYTES) * _ALIGNMENT_BYTES
