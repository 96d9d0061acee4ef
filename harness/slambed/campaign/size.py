# SPDX-License-Identifier: Apache-2.0
"""Disk use of runs, and runs that are in no plan."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slambed.campaign.store import RunStore
from slambed.errors import SlambedError
from slambed.files.json_file import read_object

MEGABYTE = 1e6


@dataclass(frozen=True)
class Size:
    """Number and size of some runs, with all their attempts."""

    runs: int
    bytes: int

    def __str__(self) -> str:
        return f"{self.runs} runs, {self.bytes / MEGABYTE:.1f} MB"


def plans(results: Path) -> Iterator[tuple[str, set[str]]]:
    """Yields every experiment with the keys in its plans, for all engines."""
    for path in sorted(results.glob("*/experiment.json")):
        keys = keys_of(read_object(path))
        if keys is None:
            # Its runs are unknown, so it is not safe to delete any.
            raise SlambedError(f"{path} is not whole; run the experiment again first")
        yield path.parent.name, keys


def keys_of(plan: dict[str, Any] | None) -> set[str] | None:
    """Returns the keys of the runs in an experiment.json; None if it has none."""
    listed = (plan or {}).get("runs")
    if not isinstance(listed, list) or not all(isinstance(run, dict) for run in listed):
        return None
    return {str(run["run_key"]) for run in listed if "run_key" in run}


def size_of(store: RunStore, keys: set[str]) -> Size:
    """Returns the disk use of these runs; a shared (hard-linked) file counts once."""
    there = keys & set(store.keys())
    folders = [place / key for key in there for place in (store.runs, store.attempts)]
    files = {f.stat().st_ino: f.stat().st_blocks for d in folders for f in d.rglob("*")}
    return Size(len(there), 512 * sum(files.values()))


def unnamed(results: Path) -> set[str]:
    """Returns the keys of runs that are in no plan of any experiment."""
    named: set[str] = set().union(*(keys for _, keys in plans(results)))
    return set(RunStore(results).keys()) - named
