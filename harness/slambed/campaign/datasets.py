# SPDX-License-Identifier: Apache-2.0
"""The sequences of a campaign, prepared and checked once."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slambed.errors import SlambedError
from slambed.spec.experiment import Playback

NS_PER_S = 1e9


@dataclass(frozen=True)
class Sequence:
    """A prepared sequence as a campaign needs it."""

    id: str
    checksum: str
    sensor: str
    path: Path
    times_s: np.ndarray

    def played_s(self, playback: Playback) -> float:
        """How long playback lasts at recorded speed."""
        end_s = float(self.times_s[-1])
        if playback.start_s >= end_s:
            raise SlambedError(
                f"playback.start_s {playback.start_s} is after the end of sequence {self.id}, "
                f"which lasts {end_s:.1f} s"
            )
        return min(end_s, playback.end_s or end_s) - playback.start_s


def sensor_of(name: str) -> str:
    """What a dataset was recorded with, known without preparing it."""
    from slambed.data.catalog import Catalog
    from slambed.data.prepared import SEQUENCE_FILE, PreparedSequence

    if (Path(name) / SEQUENCE_FILE).is_file():
        return PreparedSequence.open(name).info.sensor
    return Catalog.load().resolve(name).sensor


def prepare_sequence(name: str) -> Sequence:
    """Prepares a dataset, and reads every frame of it once against its checksums."""
    from slambed.data.catalog import prepare

    prepared = prepare(name)
    prepared.verify(full=True)
    return Sequence(
        id=prepared.info.id,
        checksum=prepared.checksum,
        sensor=prepared.info.sensor,
        path=prepared.path,
        times_s=prepared.times_s,
    )
