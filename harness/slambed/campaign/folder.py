# SPDX-License-Identifier: Apache-2.0
"""results/<experiment>/: what exists, and how a run gets in - whole, or not at all."""

import json
import os
import shutil
from pathlib import Path
from typing import Any, Literal

from slambed.errors import environment_error

State = Literal["valid", "invalid", "missing"]

RESULT_FILES = ("manifest.json", "summary.json")
MOBILE_FILES = ("trajectory.txt", "trajectory_live.txt", "map.slm")
NODE_FILES = ("node.json", "ready.json", "log.txt")
ROLES = ("mobile", "edge")
FULL_BYTES = 1 << 20
"""A disk with less than this is full: a run leaves some hundred kilobytes at least."""


class ResultFolder:
    """The results of one experiment."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.runs = path / "runs"
        self.work = path / ".work"
        self.stale = path / "stale"

    def create(self) -> None:
        """Makes the folders and throws away what a killed campaign left half done."""
        try:
            self.runs.mkdir(parents=True, exist_ok=True)
            shutil.rmtree(self.work, ignore_errors=True)
            self.work.mkdir(exist_ok=True)
        except OSError as error:
            raise environment_error(
                f"cannot write results: {error.strerror}, {self.path}"
            ) from None

    def state(self, run_key: str) -> State:
        """What is there of a run. A torn or foreign folder counts as missing."""
        summary = self.read(run_key, "summary.json")
        if summary is None or self.read(run_key, "manifest.json") is None:
            return "missing"
        return "valid" if summary.get("valid") is True else "invalid"

    def read(self, run_key: str, name: str) -> dict[str, Any] | None:
        """A JSON file of a run, None when it is not there or not whole."""
        return read_object(self.runs / run_key / name)

    def run_keys(self) -> list[str]:
        """Names of all run folders."""
        if not self.runs.is_dir():
            return []
        return sorted(p.name for p in self.runs.iterdir() if p.is_dir())

    def set_aside(self, run_key: str) -> None:
        """Moves a run that no longer belongs to the experiment out of sight of the report."""
        self.stale.mkdir(exist_ok=True)
        target = self.stale / run_key
        shutil.rmtree(target, ignore_errors=True)
        (self.runs / run_key).rename(target)

    def new_raw(self, run_key: str) -> Path:
        """An empty folder for the raw files of a run."""
        raw = self.work / run_key
        shutil.rmtree(raw, ignore_errors=True)
        raw.mkdir()
        # The nodes of containers run as another user and must be able to enter.
        raw.chmod(0o755)
        return raw

    def is_full(self) -> bool:
        """Whether the disk has no room for one more run."""
        return shutil.disk_usage(self.path).free < FULL_BYTES

    def commit(self, run_key: str, raw: Path) -> None:
        """Gives a finished raw folder its final form and its place, by one rename."""
        tidy = self.work / f"{run_key}.whole"
        shutil.rmtree(tidy, ignore_errors=True)
        (tidy / "nodes").mkdir(parents=True)
        for name in RESULT_FILES:
            _move(raw / name, tidy / name)
        for table in raw.glob("*.parquet"):
            _move(table, tidy / table.name)
        for name in MOBILE_FILES:
            _move(raw / "mobile" / name, tidy / name)
        for name in ("run.json", "start.json", "log.txt"):
            _move(raw / name, tidy / "nodes" / name)
        for role in ROLES:
            for name in NODE_FILES:
                _move(raw / role / name, tidy / "nodes" / role / name)
        if (raw / "link").is_dir():
            _move(raw / "link", tidy / "nodes" / "link")
        for path in [*tidy.rglob("*"), tidy]:
            _flush(path)
        place = self.runs / run_key
        if place.exists():
            place.rename(self.work / f"{run_key}.replaced")
        tidy.rename(place)
        _flush(self.runs)
        for leftover in (raw, self.work / f"{run_key}.replaced"):
            shutil.rmtree(leftover, ignore_errors=True)

    def write_json(self, name: str, content: object) -> None:
        """A file of the experiment, replaced by one rename."""
        partial = self.path / f".{name}.partial"
        partial.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n")
        _flush(partial)
        partial.rename(self.path / name)


def read_object(path: Path) -> dict[str, Any] | None:
    """A JSON object, None when it is not there or not whole."""
    try:
        content = json.loads(path.read_text())
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None


def _move(source: Path, target: Path) -> None:
    if source.exists():
        target.parent.mkdir(parents=True, exist_ok=True)
        source.rename(target)


def _flush(path: Path) -> None:
    """Its bytes (or, for a folder, its names) on disk."""
    fd = os.open(path, os.O_RDONLY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)
