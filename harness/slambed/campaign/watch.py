# SPDX-License-Identifier: Apache-2.0
"""Active campaigns and their runs in progress, from files only."""

import time
from dataclasses import dataclass, field
from pathlib import Path

from slambed.campaign.campaign_state import (
    STARTED,
    CampaignState,
    Entry,
    InHand,
    campaign_states,
    state_of_ledger,
    title_of,
)
from slambed.campaign.growing_file import GrowingFile
from slambed.campaign.recordings import played_frames
from slambed.campaign.run_in_hand import Playing, RunFollower
from slambed.campaign.work_place import raw_of
from slambed.data import places
from slambed.data.cache import SequenceCache
from slambed.errors import SlambedError
from slambed.files.json_file import object_or_empty
from slambed.spec.run_spec import RunSpec


@dataclass(frozen=True)
class Watched:
    """The state of one campaign at one time."""

    state: CampaignState
    title: str
    engine: str | None
    playing: list[Playing] = field(default_factory=list)


class CampaignWatch:
    """Follows the last campaign of one experiment."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._ledger = GrowingFile(folder / "ledger.jsonl")
        self._entries: list[Entry] = []
        self._runs: dict[tuple[str, float], RunFollower] = {}
        self._specs: dict[str, RunSpec] = {}
        self._offered: dict[tuple[str, str], int | None] = {}
        self._title = title_of(folder)
        self._pid = 0

    def look(self) -> Watched | None:
        """Returns the current state; None if no campaign has begun."""
        for entry in self._ledger.new():
            if entry.get("event") == STARTED:
                self._entries = []
            self._entries.append(entry)
        state = state_of_ledger(self._folder.name, self._entries, time.time())
        if state is None:
            return None
        if state.pid != self._pid:
            self._pid, self._specs = state.pid, _specs(self._folder)
        in_hand = {(run.run_key, run.since_s): run for run in state.in_hand}
        results = self._folder.parent
        kept = {key: follower for key, follower in self._runs.items() if key in in_hand}
        for key, run in in_hand.items():
            if key not in kept and (raw := raw_of(results, self._pid, key[0])) is not None:
                kept[key] = RunFollower(run, raw, self._frames(run))
        self._runs = kept
        now_s = time.time()
        playing = [
            kept[key].look(now_s) if key in kept else _not_begun(run, now_s)
            for key, run in in_hand.items()
        ]
        engines = {spec.engine for spec in self._specs.values()}
        engine = engines.pop() if len(engines) == 1 else None
        return Watched(state, self._title, engine, playing)

    def _frames(self, run: InHand) -> int | None:
        """Returns the number of frames in the playback plan, if the sequence is on this machine."""
        spec = self._specs.get(run.run_key)
        if spec is None:
            return None
        key = (spec.sequence_checksum, spec.playback.model_dump_json())
        if key not in self._offered:
            self._offered[key] = _frames_of(spec)
        return self._offered[key]


def _frames_of(spec: RunSpec) -> int | None:
    try:
        cache = SequenceCache(places.prepared_folder())
        sequence = cache.of_checksum(spec.sequence_checksum)
    except SlambedError:  # unreadable cache
        return None
    return None if sequence is None else len(played_frames(sequence, spec.playback))


def _not_begun(run: InHand, now_s: float) -> Playing:
    return Playing(run.run_key, run.name, now_s - run.since_s)


def _specs(folder: Path) -> dict[str, RunSpec]:
    """Returns the runs of an experiment by key, without those of incompatible versions."""
    found: dict[str, RunSpec] = {}
    listed = object_or_empty(folder / "experiment.json").get("runs")
    for run in listed if isinstance(listed, list) else []:
        try:
            key = str(run.pop("run_key"))
            found[key] = RunSpec.model_validate(run)
        except (AttributeError, KeyError, ValueError):
            continue
    return found


def running(results: Path) -> list[str]:
    """Returns the experiments with an active campaign."""
    return [state.experiment for state in campaign_states(results, time.time()) if state.alive]
