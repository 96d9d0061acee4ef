# SPDX-License-Identifier: Apache-2.0
"""`slambed report --again`: recomputes every number of an experiment from its stored events."""

import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from slambed.data.catalog import Catalog
from slambed.data.prepared import SEQUENCE_FILE, PreparedSequence
from slambed.errors import SlambedError
from slambed.files.atomic import replacing
from slambed.files.json_file import read_object
from slambed.metrics.recompute_run import recompute_run
from slambed.report.cells import text
from slambed.report.load import Results, load

TruthOf = Callable[[str, set[str]], Path | None]
"""Maps dataset and checksums of the played sequences to today's ground truth of one of them; None
if it is not on this machine."""
MOST_KEYS = 8


@dataclass
class Recomputed:
    """The result of recomputing numbers."""

    runs: int = 0
    changed: Counter[str] = field(default_factory=Counter)
    """Maps a key to the number of runs in which its value changed."""
    truths: list[str] = field(default_factory=list)
    """Datasets whose ground truth differs from the one stored with the runs."""
    absent: list[str] = field(default_factory=list)
    """Datasets that the experiment gives by path, but that do not exist."""
    problems: list[str] = field(default_factory=list)

    def lines(self) -> list[str]:
        """Returns the result as text lines."""
        lines = [f"the ground truth of {name} has changed" for name in self.truths]
        message = ", ".join(
            f"{key} ({count})" for key, count in self.changed.most_common(MOST_KEYS)
        )
        more = len(self.changed) - MOST_KEYS
        lines.append(
            f"numbers of {self.runs} runs computed again; changed: {message or 'none'}"
            + (f" and {more} more" if more > 0 else "")
        )
        lines += [
            f"note: {path} is not there; ground truth is what was kept beside the runs"
            for path in self.absent
        ]
        return [*lines, *self.problems]


def recompute(
    folder: Path, truth_of: TruthOf | None = None, only_refused: bool = False
) -> Recomputed:
    """Updates the stored ground truths, then recomputes every summary of a results folder (or those
    that the report refuses). A run whose files are missing keeps its numbers and is reported."""
    done = Recomputed()
    results = load(folder)
    given = _given_by_path(results)
    if truth_of is None:
        done.absent = [path for path in given if not (Path(path) / SEQUENCE_FILE).is_file()]
    for dataset in dict.fromkeys(map(text, results.runs["dataset"])):
        checksums = _checksums(results, dataset)
        current = (
            truth_of(dataset, checksums) if truth_of else prepared_truth(dataset, checksums, given)
        )
        if current is not None and _keep(current, results.groundtruth_file(dataset)):
            done.truths.append(dataset)
    if done.truths:
        results = load(folder)
    keys = results.refused if only_refused else list(results.runs["run_key"])
    datasets = dict(zip(results.runs["run_key"], results.runs["dataset"], strict=True))
    for key in keys:
        truth = results.groundtruth_file(text(datasets[key]))
        try:
            changed = recompute_run(results.run_dir(key), truth if truth.is_file() else None)
        except SlambedError as error:
            done.problems.append(str(error))
            continue
        done.runs += 1
        done.changed.update(changed)
    return done


def recompute_refused(folder: Path) -> Recomputed | None:
    """Recomputes the runs that the report would otherwise leave out; None if there are none."""
    refused: list[str] = load(folder).refused
    return recompute(folder, lambda *_: None, only_refused=True) if refused else None


def prepared_truth(dataset: str, checksums: set[str], given: Sequence[str] = ()) -> Path | None:
    """Returns the ground truth of the prepared sequence that was played, if it exists: among the
    experiment's folders by path, else the newest of this dataset id."""
    for path in given:
        with suppress(SlambedError):
            file = Path(path).suffix in (".yaml", ".yml")
            played = Catalog.load().prepared(path) if file else PreparedSequence.open(path)
            if played is not None and played.info.id == dataset and played.checksum in checksums:
                return played.groundtruth_file
    with suppress(SlambedError):
        known = Catalog.load().prepared(dataset)
        if known is not None and known.checksum in checksums:
            return known.groundtruth_file
    return None


def _given_by_path(results: Results) -> list[str]:
    """Returns datasets of the experiment that are given by path: files, or prepared folders."""
    names = results.spec.get("datasets")
    given = [name for name in names if isinstance(name, str)] if isinstance(names, list) else []
    return [name for name in given if "/" in name or (Path(name) / SEQUENCE_FILE).is_file()]


def _checksums(results: Results, dataset: str) -> set[str]:
    """Returns the checksums of the sequences that a dataset's runs played."""
    keys = results.runs.loc[results.runs["dataset"] == dataset, "run_key"]
    manifests = (read_object(results.run_dir(str(key)) / "manifest.json") or {} for key in keys)
    return {str(m["sequence_checksum"]) for m in manifests if m.get("sequence_checksum")}


def _keep(current: Path, kept: Path) -> bool:
    """Replaces the stored ground truth atomically, and returns whether it was a different one."""
    if not kept.is_file() or kept.read_bytes() == current.read_bytes():
        return False
    with replacing(kept, rivals=True) as copy:
        shutil.copyfile(current, copy)
    return True
