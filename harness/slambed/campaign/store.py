# SPDX-License-Identifier: Apache-2.0
"""results/runs/: every run that was ever executed, by its key. Nothing here is moved or replaced
for what an experiment asks; a run gets in whole, or not at all.
"""

import contextlib
import fcntl
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from slambed.campaign.work_place import WORK, work_name
from slambed.errors import environment_error
from slambed.files.json_file import read_object
from slambed.metrics.digest import MOBILE_FILES
from slambed.metrics.run_data import REFERENCE_FILE
from slambed.metrics.summary import Summary
from slambed.records.manifest import Manifest

State = Literal["valid", "invalid", "missing"]

STORE = "runs"
"""No experiment may be called so."""
ATTEMPTS = "attempts"
LOCK = ".lock"
RESULT_FILES = ("manifest.json", "summary.json", REFERENCE_FILE)
NODE_FILES = ("node.json", "ready.json", "log.txt")
ROLES = ("mobile", "edge")
FULL_BYTES = 1 << 20
"""A disk with less than this is full: a run leaves some hundred kilobytes at least."""
FULL_FILES = 64
"""The same of its number of files."""


class RunStore:
    """Runs by key, the invalid attempts, and this campaign's work folder."""

    def __init__(self, results: Path) -> None:
        self.results = results
        self.runs = results / STORE
        self.attempts = results / ATTEMPTS
        self.work: Path | None = None
        """Ours alone, from `open` to `close`."""
        self._lock = -1

    def open(self) -> None:
        """Makes the folders and removes what killed campaigns left half done; what a living one
        has in hand stays."""
        try:
            self.runs.mkdir(parents=True, exist_ok=True)
            everybody = self.results / WORK
            everybody.mkdir(exist_ok=True)
            with _locked(everybody / LOCK):
                for folder in everybody.iterdir():
                    if folder.is_dir() and not _is_locked(folder / LOCK):
                        shutil.rmtree(folder, ignore_errors=True)
                self.work = everybody / work_name()
                self.work.mkdir()
                self._lock = os.open(self.work / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC)
                fcntl.flock(self._lock, fcntl.LOCK_EX)
        except OSError as error:
            raise environment_error(
                f"cannot write results: {error.strerror}, {error.filename or self.results}"
            ) from None

    def close(self) -> None:
        """Leaves nothing of this campaign but its runs."""
        if self.work is not None:
            shutil.rmtree(self.work, ignore_errors=True)
            self.work = None
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def state(self, run_key: str) -> State:
        """What is there of a run. A torn or foreign folder counts as missing."""
        summary = self.summary(run_key)
        # Its manifest may be of any version: to be missing is to be executed again.
        if summary is None or read_object(self.runs / run_key / "manifest.json") is None:
            return "missing"
        return "valid" if summary.valid else "invalid"

    def summary(self, run_key: str) -> Summary | None:
        """Of a run; None when it is not there or not whole."""
        return Summary.read(self.runs / run_key / "summary.json")

    def manifest(self, run_key: str) -> Manifest | None:
        """Of a run; None when it is not there or not whole."""
        return Manifest.read(self.runs / run_key / "manifest.json")

    def keys(self) -> list[str]:
        """Of all runs."""
        if not self.runs.is_dir():
            return []
        return sorted(p.name for p in self.runs.iterdir() if p.is_dir())

    def attempts_of(self, run_key: str) -> int:
        """How often a run was executed to its end."""
        earlier = self.attempts / run_key
        count = sum(1 for _ in earlier.iterdir()) if earlier.is_dir() else 0
        return count + (self.state(run_key) != "missing")

    def new_raw(self, run_key: str) -> Path:
        """An empty folder for the raw files of a run."""
        assert self.work is not None
        raw = self.work / run_key
        shutil.rmtree(raw, ignore_errors=True)
        raw.mkdir()
        # The nodes of containers run as another user and must be able to enter.
        raw.chmod(0o755)
        return raw

    def is_full(self) -> bool:
        """Whether the disk has no room for one more run."""
        disk = os.statvfs(self.results)
        # File systems without a table of files say 0 of 0.
        no_files = disk.f_files > 0 and disk.f_favail < FULL_FILES
        return disk.f_bavail * disk.f_frsize < FULL_BYTES or no_files

    def commit(self, run_key: str, raw: Path, replace: bool = False) -> None:
        """Gives a finished raw folder its final form and its place, by one rename.

        An earlier invalid attempt is kept; a valid one, which a campaign beside
        this one has made meanwhile, stays, or becomes an earlier attempt where it is replaced.
        """
        assert self.work is not None
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
        self.put(run_key, tidy, replace)
        shutil.rmtree(raw, ignore_errors=True)

    def put(self, run_key: str, tidy: Path, replace: bool = False) -> None:
        """Gives a folder of final form, which lies in `work`, its place by one rename."""
        for path in [*tidy.rglob("*"), tidy]:
            _flush(path)
        with _locked(self.results / WORK / LOCK):
            if replace or self.state(run_key) != "valid":
                self._set_aside(run_key)
                tidy.rename(self.runs / run_key)
                _flush(self.runs)
        shutil.rmtree(tidy, ignore_errors=True)

    def _set_aside(self, run_key: str) -> None:
        """An attempt is kept by its number, what is torn is removed."""
        place = self.runs / run_key
        if self.state(run_key) == "missing":
            shutil.rmtree(place, ignore_errors=True)
            return
        kept = self.attempts / run_key
        kept.mkdir(parents=True, exist_ok=True)
        place.rename(kept / f"{sum(1 for _ in kept.iterdir()) + 1}")

    def remove(self, run_key: str) -> None:
        """Frees a run with all its attempts."""
        for folder in (self.runs / run_key, self.attempts / run_key):
            shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """While others wait; the kernel frees it however we die."""
    fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX)
        yield
    finally:
        os.close(fd)


def _is_locked(path: Path) -> bool:
    try:
        fd = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(fd)
    return False


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
