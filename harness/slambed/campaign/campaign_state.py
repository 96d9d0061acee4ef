# SPDX-License-Identifier: Apache-2.0
"""Progress of a campaign, from its ledger and its process.

This module takes no locks: even a brief test of a lock could make a campaign fail that starts at
that moment.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import psutil

from slambed.campaign.ledger import Ledger
from slambed.files.json_file import read_object
from slambed.older_names import LEDGER, keys_today
from slambed.spec.run_spec import run_name

CLOCKS_APART_S = 2.0
"""Tolerance for a ledger line that seems older than its process: both times are rounded."""
STARTED, ENDED = "campaign_started", "campaign_ended"


@dataclass(frozen=True)
class InHand:
    """A run in progress."""

    run_key: str
    name: str
    since_s: float
    """Unix time of the start of this attempt."""


@dataclass(frozen=True)
class CampaignState:
    """The most recent campaign in the ledger of an experiment."""

    experiment: str
    pid: int
    alive: bool
    """Whether its process exists and the campaign has not ended."""
    began_s: float
    """Unix time."""
    ended: bool
    """Whether it logged its end; if neither `alive` nor `ended` holds, it was killed."""
    interrupted: bool
    asked: int
    """Number of runs that it had to execute."""
    there_before: int
    valid: int
    invalid: int
    """Finished but invalid runs; they are repeated while attempts are left."""
    failed: int
    """Runs whose last attempt gave no result."""
    in_hand: list[InHand] = field(default_factory=list)
    left_s: float | None = None
    """Expected remaining time; None before the first run has finished."""

    @property
    def done(self) -> int:
        """Number of runs with a result."""
        return self.valid + self.invalid

    @property
    def waiting(self) -> int:
        """Number of runs that have not started."""
        return max(0, self.asked - self.done - self.failed - len(self.in_hand))


Entry = dict[str, Any]
Alive = Callable[[int, float], bool]
"""(process id, Unix time) -> whether the process of that time still exists."""


def is_alive(pid: int, since_s: float) -> bool:
    """Returns whether the process that existed at that time still runs. Process ids are reused,
    and a zombie keeps its id until its parent reaps it."""
    try:
        process = psutil.Process(pid)
        there = process.status() != psutil.STATUS_ZOMBIE
        began_s = process.create_time()
    except psutil.Error:
        return False
    return there and began_s <= since_s + CLOCKS_APART_S


def state_of_ledger(
    experiment: str, entries: Iterable[Entry], now_s: float, alive: Alive = is_alive
) -> CampaignState | None:
    """Returns the last campaign of a ledger; None if there is none."""
    last: list[Entry] = []
    for entry in entries:
        if entry.get("event") == STARTED:
            last = [entry]
        elif last:
            last.append(entry)
    if not last:
        return None
    begin = last[0]
    asked = [str(key) for key in begin.get("todo") or []]
    pid, began_s = int(begin.get("pid") or 0), unix_time(begin)
    latest, durations_s, most_at_once = _follow(last[1:], asked)
    kinds = {key: entry["event"] for key, entry in latest.items()}
    finished = [e for e in latest.values() if e["event"] == "run_finished"]
    valid = sum(keys_today(entry, LEDGER).get("valid") is True for entry in finished)
    living = alive(pid, began_s)
    ended = next((e for e in last if e.get("event") == ENDED), None)
    running = living and ended is None
    in_hand = [
        InHand(key, run_name(entry.get("cell"), entry.get("repetition")), unix_time(entry))
        for key, entry in latest.items()
        if running and entry["event"] == "run_started"
    ]
    state = CampaignState(
        experiment=experiment,
        pid=pid,
        alive=running,
        began_s=began_s,
        ended=ended is not None,
        interrupted=bool(ended and ended.get("interrupted")),
        asked=len(asked),
        there_before=_there_before(begin, len(asked)),
        valid=valid,
        invalid=len(finished) - valid,
        failed=sum(kind == "run_failed" for kind in kinds.values()),
        in_hand=in_hand,
    )
    left_s = _left_s(state, durations_s, most_at_once, now_s) if running else None
    return CampaignState(**{**vars(state), "left_s": left_s})


def _there_before(begin: Entry, asked: int) -> int:
    """Returns how many of the wanted runs were there; ledgers of before 2026-11-29 have no count
    of these alone."""
    if isinstance(there := begin.get("there"), int):
        return there
    return max(0, int(begin.get("runs") or 0) - asked)


def _follow(entries: list[Entry], asked: list[str]) -> tuple[dict[str, Entry], list[float], int]:
    """Returns the last entry of each planned run, the durations of finished runs, and the
    maximum number of concurrent runs."""
    latest: dict[str, Entry] = {}
    began_s: dict[str, float] = {}
    durations_s: list[float] = []
    most, wanted = 1, set(asked)
    for entry in entries:
        key = entry.get("run_key")
        if key not in wanted:
            continue
        latest[key] = entry
        if entry["event"] == "run_started":
            began_s[key] = unix_time(entry)
            most = max(most, len(began_s))
        elif (begin_s := began_s.pop(key, None)) is not None and entry["event"] == "run_finished":
            durations_s.append(unix_time(entry) - begin_s)
    return latest, durations_s, most


def _left_s(
    state: CampaignState, durations_s: list[float], at_once: int, now_s: float
) -> float | None:
    if not durations_s:
        return None
    each_s = sum(durations_s) / len(durations_s)
    in_hand_s = sum(max(0.0, each_s - (now_s - run.since_s)) for run in state.in_hand)
    return (each_s * state.waiting + in_hand_s) / at_once


def unix_time(entry: Entry) -> float:
    """Returns the Unix time of a ledger line; 0 if it has none."""
    try:
        when = datetime.fromisoformat(str(entry.get("time_utc")))
    except ValueError:
        return 0.0
    return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()


def campaign_states(results: Path, now_s: float) -> list[CampaignState]:
    """Returns the last campaign of every experiment in a results folder, sorted by name."""
    found = [state_of(path.parent, now_s) for path in sorted(results.glob("*/ledger.jsonl"))]
    return [state for state in found if state is not None]


def state_of(folder: Path, now_s: float) -> CampaignState | None:
    """Returns the last campaign in the folder of one experiment."""
    return state_of_ledger(folder.name, Ledger(folder / "ledger.jsonl").read(), now_s)


def being_run(results: Path, experiment: str) -> list[str]:
    """Returns a line about a campaign that is executing the experiment now; empty without one."""
    state = state_of(results / experiment, time.time())
    if state is None or not state.alive:
        return []
    return [f"being run by process {state.pid}: {state.done} of {state.asked} runs so far"]


def title_of(folder: Path) -> str:
    """Returns the title of an experiment, or its folder's name if no title was stored."""
    content = read_object(folder / "experiment.json") or {}
    spec = content.get("experiment")
    title = spec.get("title") if isinstance(spec, dict) else None
    return str(title or content.get("title") or folder.name)
