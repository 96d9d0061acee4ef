# SPDX-License-Identifier: Apache-2.0
"""Recorded folders for systems that read one: the played part of a sequence, exported once and
cached."""

import fcntl
import hashlib
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slambed.data.places import cache_folder, no_cache
from slambed.data.playlist import offered_frames
from slambed.data.prepared import PreparedSequence
from slambed.errors import environment_error
from slambed.spec.experiment import Playback

EXPORT_VERSION = 1
"""To be incremented with every change of what `export` writes, which invalidates older folders."""
FOLDERS = "recorded"
_DIGITS = 12


@dataclass(frozen=True)
class Recording:
    """The played frames of a sequence as a folder in some layout."""

    sequence: PreparedSequence
    layout: str
    indices: NDArray[np.intp]
    """Indices in the prepared sequence."""
    cache: Path
    """Cache of the folders."""

    @classmethod
    def of(
        cls, sequence: PreparedSequence, playback: Playback, layout: str, cache: Path | None = None
    ) -> "Recording":
        """Returns the frames of this playback; its mode has no effect on a system that reads a
        folder."""
        indices = played_frames(sequence, playback)
        return cls(sequence, layout, indices, cache or cache_folder())

    @property
    def folder_stamps_s(self) -> NDArray[np.float64]:
        """Timestamps in the folder."""
        from slambed.data.export import folder_times_ns  # loads OpenCV

        stamps_ns = folder_times_ns(self.sequence, self.layout)[self.indices]
        return np.asarray(stamps_ns / 1e9, dtype=np.float64)

    @property
    def recorded_s(self) -> NDArray[np.float64]:
        """Recorded time, which trajectories use."""
        return self.sequence.info.time_origin_s + self.sequence.times_s[self.indices]

    @property
    def seq_s(self) -> NDArray[np.float64]:
        """Sequence time since the first played frame."""
        times_s = self.sequence.times_s[self.indices]
        return np.asarray(times_s - times_s[0], dtype=np.float64)

    def folder(self) -> Path:
        """Returns the cached folder, written now if missing. It contains no ground truth, so
        that a system under test cannot read it. Raises SlambedError if the cache cannot be
        written."""
        place = self.cache / FOLDERS
        path = place / self._name()
        try:
            place.mkdir(parents=True, exist_ok=True)
            with (place / ".lock").open("w") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                if not path.is_dir():
                    self._write(path)
        except OSError as refused:
            raise no_cache(place, refused) from refused
        return path

    def _write(self, path: Path) -> None:
        from slambed.data.export import export

        for killed in path.parent.glob(".*.partial-*"):
            shutil.rmtree(killed, ignore_errors=True)
        # A PNG is never much larger than its pixels.
        needed = len(self.indices) * self.sequence.info.frame_stride_bytes
        free = shutil.disk_usage(path.parent).free
        if needed > free:
            raise environment_error(
                f"{path.parent}: up to {needed / 1e9:.1f} GB needed, {free / 1e9:.1f} GB free; "
                "free some or set SLAMBED_CACHE to another disk"
            )
        export(self.sequence, self.layout, path, indices=self.indices, with_truth=False)

    def _name(self) -> str:
        frames = np.asarray(self.indices, dtype="<i8").tobytes()
        content = f"{EXPORT_VERSION} {self.layout} {self.sequence.checksum} ".encode() + frames
        digest = hashlib.sha256(content).hexdigest()[:_DIGITS]
        return f"{self.sequence.info.id}-{self.layout}-{digest}"


def played_frames(sequence: PreparedSequence, playback: Playback) -> NDArray[np.intp]:
    """Returns the indices of the frames that a playback offers."""
    times_ns = sequence.index["timestamp_ns"].astype(np.int64)
    return offered_frames(
        times_ns, sequence.info.fps, playback.fps, playback.start_s, playback.end_s
    )
