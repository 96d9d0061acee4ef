# SPDX-License-Identifier: Apache-2.0
"""The sequences of a campaign, prepared and verified once."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from slambed.campaign.progress import duration
from slambed.data.playlist import keep_every
from slambed.data.prepared import SEQUENCE_FILE
from slambed.data.recipe import DatasetPlayback
from slambed.errors import SlambedError
from slambed.spec.experiment import Playback

if TYPE_CHECKING:
    from slambed.data.catalog import Catalog
    from slambed.data.prepared import PreparedSequence, SequenceInfo
    from slambed.data.recipe import Dataset

NS_PER_S = 1e9
REPORTED_EVERY_S = 15.0
_SAME_RATE = 0.02
"""Relative difference between rates that is not worth a remark, as of 29.97 and 30 fps."""


@dataclass(frozen=True)
class Sequence:
    """A prepared sequence with the facts that a campaign needs."""

    id: str
    checksum: str
    sensor: str
    path: Path
    times_s: np.ndarray
    stands_in_for: str = ""
    """The dataset that this sequence replaces because it is not on this machine."""
    defaults: DatasetPlayback = field(default_factory=DatasetPlayback)
    """`playback` in the dataset's file."""
    prior_map: str | None = None
    reference: str | None = None
    """Prepared input that the dataset's file names, like `prior_map`."""

    def playback(self, asked: Playback) -> Playback:
        """Returns the experiment's playback, with defaults from the dataset's file."""
        open_keys = self.defaults.model_fields_set - asked.model_fields_set
        if not open_keys:
            return asked
        own = self.defaults.model_dump(include=open_keys)
        try:
            return Playback.model_validate(asked.model_dump() | own)
        except ValueError:
            end_s = self.defaults.end_s
            end = "the end" if end_s is None else f"{end_s:g} s"
            given = asked.model_dump(include=asked.model_fields_set & {"start_s", "end_s"})
            theirs = ", ".join(f"{key} {value:g}" for key, value in given.items())
            raise SlambedError(
                f"dataset {self.id} plays from {self.defaults.start_s:g} s to {end} by its file, "
                f"which does not go with the experiment's {theirs}; give start_s and end_s there"
            ) from None

    def played_s(self, playback: Playback) -> float:
        """Returns the duration of playback at recorded speed."""
        playback = self.playback(playback)
        end_s = float(self.times_s[-1])
        if playback.start_s >= end_s:
            raise SlambedError(
                f"playback.start_s {playback.start_s} is after the end of sequence {self.id}, "
                f"which lasts {end_s:.1f} s"
            )
        return min(end_s, playback.end_s or end_s) - playback.start_s


def sensor_of(name: str) -> str:
    """Returns the sensor type of a dataset without preparing it."""
    return _described(name).sensor


def other_rate(name: str, asked: float | None) -> str:
    """Returns at which rate a dataset is played that has no frames at the rate that is asked for;
    empty if it has. Prepares nothing."""
    if asked is None:
        return ""
    recorded = _described(name).fps
    n = keep_every(recorded, asked)
    if abs(recorded / n / asked - 1) < _SAME_RATE:
        return ""
    frames = "all are" if n == 1 else f"one of {n} is"
    return (
        f"playback.fps {asked:g}: {name} has {recorded:g} fps, of which {frames} played: "
        f"{recorded / n:.4g} fps"
    )


def _described(name: str) -> Dataset | SequenceInfo:
    """Returns what is known about a dataset without preparing it."""
    from slambed.data.catalog import Catalog
    from slambed.data.prepared import PreparedSequence

    if (Path(name) / SEQUENCE_FILE).is_file():
        return PreparedSequence.open(name).info
    catalog = Catalog.load()
    return catalog.whole(catalog.resolve(name))


def sequence_id(name: str) -> str:
    """Returns the ID of the sequence that a dataset becomes, or that replaces it here; prepares
    nothing."""
    from slambed.data.catalog import Catalog
    from slambed.data.prepared import PreparedSequence

    if (Path(name) / SEQUENCE_FILE).is_file():
        return PreparedSequence.open(name).info.id
    return Catalog.load().resolve(name).id


def must_be_here(name: str) -> None:
    """Raises MissingDataError for a dataset without a source on this machine; prepares nothing."""
    from slambed.data.catalog import Catalog

    if not (Path(name) / SEQUENCE_FILE).is_file():
        Catalog.load().must_be_here(name)


def stand_in(name: str) -> str:
    """Returns which dataset is replaced by which, and how to get it; empty if none is."""
    from slambed.data.catalog import Catalog
    from slambed.data.download import how_to_get
    from slambed.data.stand_in import played_instead

    if (Path(name) / SEQUENCE_FILE).is_file():
        return ""
    catalog = Catalog.load()
    if (wanted := catalog.stands_in_for(name)) is None:
        return ""
    message = played_instead(catalog.resolve(name).id, wanted.id, name)
    return "; ".join(filter(None, [message, how_to_get(catalog.original(wanted))]))


def prior_map_of(name: str) -> str | None:
    """Returns the prior map that a dataset's file names; prepares nothing."""
    from slambed.data.catalog import Catalog

    if (Path(name) / SEQUENCE_FILE).is_file():
        return None
    return Catalog.load().resolve(name).prior_map


def must_be_made(name: str) -> bool:
    """Returns whether `prepare_sequence` would first have to decode or generate the dataset."""
    from slambed.data.catalog import Catalog

    if (Path(name) / SEQUENCE_FILE).is_file():
        return False
    catalog = Catalog.load()
    return catalog.prepared(name) is None and catalog.available(catalog.resolve(name))


def prepare_sequence(name: str, notify: Callable[[str], None] = lambda line: None) -> Sequence:
    """Prepares a dataset and verifies its frames against their checksums, unless that was done
    recently. `notify` is called before the preparation, which may take minutes, and at times during
    it."""
    from slambed.data.catalog import Catalog
    from slambed.data.prepared import PreparedSequence
    from slambed.data.verified import verify_once

    given = (Path(name) / SEQUENCE_FILE).is_file()
    catalog = None if given else Catalog.load()
    dataset = catalog.resolve(name) if catalog else None
    if dataset and must_be_made(name):
        notify(f"preparing {dataset.id}: once, it is kept")
    if catalog and dataset:
        prepared = catalog.prepare(name, progress=reported(dataset.id, notify), notify=notify)
    else:
        prepared = PreparedSequence.open(name)
    verify_once(prepared)
    return _sequence(name, prepared, catalog, dataset)


def reported(
    name: str, notify: Callable[[str], None], clock: Callable[[], float] = time.monotonic
) -> Callable[[int, int], None]:
    """Returns a function that is called with the numbers of frames done and of all, and reports
    them now and then."""
    began = last = clock()

    def report(done: int, total: int) -> None:
        nonlocal last
        now = clock()
        if now - last < REPORTED_EVERY_S or not 0 < done < total:
            return
        last = now
        left_s = (now - began) * (total - done) / done
        notify(f"preparing {name}: {done:,} of {total:,} frames, about {duration(left_s)} left")

    return report


def kept_sequence(name: str) -> Sequence | None:
    """Returns the sequence if that needs no preparation; None otherwise."""
    from slambed.data.catalog import Catalog
    from slambed.data.prepared import PreparedSequence

    if (Path(name) / SEQUENCE_FILE).is_file():
        return _sequence(name, PreparedSequence.open(name), None, None)
    catalog = Catalog.load()
    prepared = catalog.prepared(name)
    return _sequence(name, prepared, catalog, catalog.resolve(name)) if prepared else None


def _sequence(
    name: str, prepared: PreparedSequence, catalog: Catalog | None, dataset: Dataset | None
) -> Sequence:
    wanted = catalog.stands_in_for(name) if catalog else None
    return Sequence(
        id=dataset.id if dataset is not None and dataset.window_of else prepared.info.id,
        checksum=prepared.checksum,
        sensor=prepared.info.sensor,
        path=prepared.path,
        times_s=prepared.times_s,
        stands_in_for=wanted.id if wanted else "",
        defaults=dataset.playback if dataset is not None else DatasetPlayback(),
        prior_map=dataset.prior_map if dataset is not None else None,
        reference=dataset.reference if dataset is not None else None,
    )
