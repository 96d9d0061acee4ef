# SPDX-License-Identifier: Apache-2.0
"""Disk use of runs, and runs that are in no plan."""

import os
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slambed.campaign.store import RunStore
from slambed.errors import SlambedError
from slambed.files.json_file import read_object
from slambed.records.kept_spec import KeptSpec
from slambed.spec.library import Library

MEGABYTE = 1e6


@dataclass(frozen=True)
class Size:
    """Number and size of some runs, with all their attempts."""

    runs: int
    bytes: int

    def __str__(self) -> str:
        return f"{self.runs} runs, {self.bytes / MEGABYTE:.1f} MB"


@dataclass(frozen=True, order=True)
class Reason:
    """Why runs are in no plan."""

    experiment: str
    why: str

    @property
    def can_return(self) -> bool:
        """Returns whether `slambed run` takes these runs again as soon as it is asked for them."""
        return self.why == OTHER_SETTINGS

    def __str__(self) -> str:
        return f"{self.experiment}, {self.why}" if self.experiment else self.why


OTHER_SETTINGS = "made with other settings than those of its last plan"
OTHER_SOURCES = "of other sources"
NO_PLAN = "which has no plan here"
NO_MANIFEST = "without a readable manifest"


def plans(results: Path) -> Iterator[tuple[str, set[str]]]:
    """Yields every experiment with the keys in its plans, for all engines."""
    for name, runs in planned(results):
        yield name, _keys(runs)


def planned(results: Path) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """Yields every experiment with the runs in its plans, as experiment.json has them."""
    for path in sorted(results.glob("*/experiment.json")):
        runs = _runs_of(read_object(path))
        if runs is None:
            # Its runs are unknown, so it is not safe to delete any.
            raise SlambedError(f"{path} is not whole; run the experiment again first")
        yield path.parent.name, runs


def keys_of(plan: dict[str, Any] | None) -> set[str] | None:
    """Returns the keys of the runs in an experiment.json; None if it has none."""
    runs = _runs_of(plan)
    return None if runs is None else _keys(runs)


def _keys(runs: list[dict[str, Any]]) -> set[str]:
    return {str(run["run_key"]) for run in runs if "run_key" in run}


def _runs_of(plan: dict[str, Any] | None) -> list[dict[str, Any]] | None:
    listed = (plan or {}).get("runs")
    if not isinstance(listed, list) or not all(isinstance(run, dict) for run in listed):
        return None
    return listed


def size_of(store: RunStore, keys: set[str]) -> Size:
    """Returns the disk use of these runs; a shared (hard-linked) file counts once."""
    there = keys & set(store.keys())
    folders = [place / key for key in there for place in (store.runs, store.attempts)]
    files: dict[int, int] = {}
    for folder in folders:
        for place, inner, names in os.walk(folder):
            for name in (*inner, *names):
                with suppress(FileNotFoundError):  # a campaign may have set the run aside
                    found = os.lstat(Path(place, name))
                    files[found.st_ino] = found.st_blocks
    return Size(len(there), 512 * sum(files.values()))


def unnamed(results: Path) -> set[str]:
    """Returns the keys of runs that are in no plan of any experiment."""
    named: set[str] = set().union(*(keys for _, keys in plans(results)))
    return set(RunStore(results).keys()) - named


def unnamed_by_reason(results: Path) -> dict[Reason, set[str]]:
    """Returns the same by the experiment that executed them, and why they are in no plan."""
    store, plans_of = RunStore(results), dict(planned(results))
    found: defaultdict[Reason, set[str]] = defaultdict(set)
    for key in unnamed(results):
        manifest = store.manifest(key)
        spec = manifest.kept if manifest is not None else KeptSpec()
        if spec.experiment is None:
            found[Reason("", NO_MANIFEST)].add(key)
        elif (runs := plans_of.get(spec.experiment)) is None:
            found[Reason(spec.experiment, NO_PLAN)].add(key)
        elif _is_taken_out(spec, runs):
            why = f"of {spec.system}:{spec.variant}, which the experiment no longer names"
            found[Reason(spec.experiment, why)].add(key)
        else:
            like_it = [r for r in runs if (r.get("system"), r.get("engine")) == _system_of(spec)]
            changed = like_it and spec.software not in [run.get("software") for run in like_it]
            why = OTHER_SOURCES if changed else OTHER_SETTINGS
            found[Reason(spec.experiment, why)].add(key)
    return {reason: found[reason] for reason in sorted(found)}


def _is_taken_out(spec: KeptSpec, runs: list[dict[str, Any]]) -> bool:
    """Returns whether neither the plan nor the experiment's file has the system of a run in this
    variant. Settings may have taken it out of the plan alone, so a file that cannot be read leaves
    it open, and the answer is no."""
    own = spec.system, spec.variant
    if any((run.get("system"), run.get("variant")) == own for run in runs):
        return False
    try:
        experiment, _ = Library().experiment(str(spec.experiment))
    except SlambedError:  # a file outside the library, or one that is gone or wrong
        return False
    choices = [(choice.system, choice.variant) for choice in experiment.systems]
    return not {own, (spec.system, None)} & set(choices)


def _system_of(spec: KeptSpec) -> tuple[str | None, str | None]:
    return spec.system, spec.engine
