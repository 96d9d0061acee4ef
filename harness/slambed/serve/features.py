# SPDX-License-Identifier: Apache-2.0
"""Features of a run's pictures, from the files that virtual runs leave in the cache, and the points
that its keyframes see."""

import json
import os
import struct
import threading
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slambed.data.prepared import PreparedSequence
from slambed.data.trajectory import Trajectory
from slambed.engines.virtual import seen_with
from slambed.native import cache_folder
from slambed.records.manifest import Manifest
from slambed.serve.thinned import numbers

Floats = NDArray[np.float64]

MAGIC, VERSION = 0x43464C53, 1
HEADER = struct.Struct("<IIQI")
"""Magic, version, number of frames, length of the key."""
BLOCK = struct.Struct("<II")
"""Number of features, CRC-32 of what follows."""
KEYPOINT = np.dtype(
    [("u", "<f4"), ("v", "<f4"), ("right_u", "<f4"), ("depth_m", "<f4"), ("angle_deg", "<f4"),
     ("octave", "<u4")]
)  # fmt: skip
DESCRIPTOR_BYTES = 32
LONGEST_KEY = 1 << 16
MOST_MAP_POINTS = 12_000
NOT_HERE = (
    "No features and no points: they come from the cache that a virtual run with the same sequence "
    "and options leaves on this machine."
)


@dataclass(frozen=True)
class FeatureFile:
    """The features of every frame of a sequence, as `slambed-sim` keeps them
    (systems/core/sequence/feature_cache.hpp)."""

    path: Path
    key: dict[str, Any]
    """What the features depend on."""
    offsets: NDArray[np.uint64]
    """Of each frame's block, [N+1]."""

    @classmethod
    def open(cls, path: Path) -> "FeatureFile | None":
        """Returns the file; None for one that is not there, damaged, or of another version."""
        try:
            with path.open("rb") as file:
                magic, version, frames, length = HEADER.unpack(file.read(HEADER.size))
                if (magic, version) != (MAGIC, VERSION) or length > LONGEST_KEY:
                    return None
                key = json.loads(file.read(length))
                file.seek(-(HEADER.size + length) % 8, os.SEEK_CUR)
                if (frames + 1) * 8 > path.stat().st_size:
                    return None
                offsets = np.frombuffer(file.read((frames + 1) * 8), "<u8")
        except (OSError, ValueError, struct.error):
            return None
        whole = isinstance(key, dict) and len(offsets) == frames + 1
        return cls(path, key, offsets) if whole else None

    def frame(self, index: int) -> NDArray[np.void] | None:
        """Returns the features of a frame, [N] of `KEYPOINT`; None where its bytes are damaged or
        the file is gone."""
        if not 0 <= index < len(self.offsets) - 1:
            return None
        begin, end = int(self.offsets[index]), int(self.offsets[index + 1])
        try:
            with self.path.open("rb") as file:
                if not begin + BLOCK.size <= end <= os.fstat(file.fileno()).st_size:
                    return None
                file.seek(begin)
                block = file.read(end - begin)
        except OSError:
            return None
        if len(block) < end - begin:  # cut since its size was asked
            return None
        count, crc = BLOCK.unpack_from(block)
        body = block[BLOCK.size :]
        if len(body) != count * (KEYPOINT.itemsize + DESCRIPTOR_BYTES) or zlib.crc32(body) != crc:
            return None
        return np.frombuffer(body, KEYPOINT, count)


class FeatureFiles:
    """Finds the features that a run saw among the files of the cache."""

    def __init__(self) -> None:
        self._found: dict[str, FeatureFile] = {}
        self._lock = threading.Lock()

    def of(self, manifest: Manifest) -> FeatureFile | None:
        """Returns the features that a run saw; None where no virtual run on this machine has kept
        them. Features of another version of the software, the newest ones, stand in for those of
        the run's own, which a live run, for example, never keeps."""
        spec = manifest.spec
        if spec is None or spec.params is None or manifest.sequence_checksum is None:
            return None
        wanted = {"sequence": manifest.sequence_checksum, **seen_with(spec.params)}
        key = json.dumps([wanted, spec.software])
        with self._lock:
            known = self._found.get(key)
            if known is not None and known.path.is_file():
                return known
            found = _found(wanted, spec.software)
            if found is not None:
                self._found[key] = found
            return found


def _found(wanted: dict[str, Any], software: str | None) -> FeatureFile | None:
    """Returns the features with this software, else the newest ones of another."""
    try:
        paths = sorted(
            (cache_folder() / "features").glob("*.features"),
            key=lambda path: -path.stat().st_mtime,
        )
    except OSError:
        return None
    same = [
        file
        for file in map(FeatureFile.open, paths)
        if file is not None
        and {name: value for name, value in file.key.items() if name != "software"} == wanted
    ]
    return max(same, key=lambda file: file.key.get("software") == software, default=None)


def frame_json(file: FeatureFile, index: int, sequence: PreparedSequence) -> dict[str, Any] | None:
    """Returns a frame's features for drawing: pixels, octave, and whether the depth is near enough
    for a map point of one keyframe; None where there are none."""
    found = file.frame(index)
    if found is None:
        return None
    return {
        "width": sequence.info.width,
        "height": sequence.info.height,
        "u": numbers(np.round(found["u"].astype(np.float64), 1).tolist()),
        "v": numbers(np.round(found["v"].astype(np.float64), 1).tolist()),
        "octave": found["octave"].tolist(),
        "near": _near(found, sequence).tolist(),
    }


def map_points(
    file: FeatureFile,
    sequence: PreparedSequence,
    keyframes: list[tuple[int, int]],
    path: Trajectory,
) -> tuple[Floats, list[int]]:
    """Returns points [N,3] in the coordinates of `path`, and how many there are after each
    keyframe: the near features of the keyframes, where their poses put them. A keyframe is a frame
    of the sequence and a pose of `path`.

    The systems keep no map in a run's folder. These are the points that a keyframe would create by
    its depth alone; the system's own are fewer, merged and optimized. One camera has none.
    """
    camera = sequence.info.camera
    points: list[Floats] = [np.zeros((0, 3))]
    ends: list[int] = []
    most = max(1, MOST_MAP_POINTS // max(1, len(keyframes)))
    rotations = path.rotations() if keyframes else None
    for index, pose in keyframes:
        found = file.frame(index)
        if found is not None and rotations is not None:
            near = found[_near(found, sequence)]
            near = near[:: max(1, -(-len(near) // most))]
            depth_m = near["depth_m"].astype(np.float64)
            x = (near["u"] - camera.cx) / camera.fx
            y = (near["v"] - camera.cy) / camera.fy
            seen = depth_m[:, None] * np.stack([x, y, np.ones(len(near))], axis=1)
            points.append(rotations[pose].apply(seen) + path.positions_m[pose])
        ends.append(sum(map(len, points)))
    return np.concatenate(points), ends


def _near(found: NDArray[np.void], sequence: PreparedSequence) -> NDArray[np.bool_]:
    camera = sequence.info.camera
    limit_m = sequence.info.close_depth_baselines * camera.bf / camera.fx
    near: NDArray[np.bool_] = (found["depth_m"] > 0) & (found["depth_m"] < limit_m)
    return near
