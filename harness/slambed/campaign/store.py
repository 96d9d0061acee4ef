# SPDX-License-Identifier: Apache-2.0
"""results/runs/: every executed run, by its key. Runs are added atomically and never moved or
replaced because of an experiment's plan.
"""

import contextlib
import fcntl
import os
import shutil
import tempfile
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
"""Reserved: not allowed as the id of an experiment."""
ATTEMPTS = "attempts"
LOCK = ".lock"
RESULT_FILES = ("manifest.json", "summary.json", REFERENCE_FILE)
LOGS = "nodes"
"""Folder of a run with what each node printed and left."""
NODE_FILES = ("node.json", "ready.json", "log.txt")
ROLES = ("mobile", "edge")
FULL_BYTES = 1 << 20
"""A disk with less free space is full: a run needs at least some hundred kilobytes."""
FULL_FILES = 64
"""The same limit for free inodes."""


class RunStore:
    """The runs by key, the earlier attempts, and this campaign's work folder."""

    def __init__(self, results: Path) -> None:
        self.results = results
        self.runs = results / STORE
        self.attempts = results / ATTEMPTS
        self.work: Path | None = None
        """Owned by this campaign between `open` and `close`."""
        self._lock = -1

    def open(self) -> None:
        """Creates the folders and removes unfinished runs of killed campaigns, but not of active
        ones."""
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
        """Removes temporary files of this campaign."""
        if self.work is not None:
            shutil.rmtree(self.work, ignore_errors=True)
            self.work = None
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def state(self, run_key: str) -> State:
        """Returns the state of a run. A truncated or foreign folder counts as missing."""
        summary = self.summary(run_key)
        # The manifest may be of any version: a missing run would be executed again.
        if summary is None or read_object(self.runs / run_key / "manifest.json") is None:
            return "missing"
        return "valid" if summary.valid else "invalid"

    def summary(self, run_key: str) -> Summary | None:
        """Returns the summary of a run; None if it is missing or truncated."""
        return Summary.read(self.runs / run_key / "summary.json")

    def manifest(self, run_key: str) -> Manifest | None:
        """Returns the manifest of a run; None if it is missing or truncated."""
        return Manifest.read(self.runs / run_key / "manifest.json")

    def keys(self) -> list[str]:
        """Returns the keys of all runs."""
        if not self.runs.is_dir():
            return []
        return sorted(p.name for p in self.runs.iterdir() if p.is_dir())

    def attempts_of(self, run_key: str) -> int:
        """Returns how often a run was executed to its end."""
        earlier = self.attempts / run_key
        count = sum(1 for _ in earlier.iterdir()) if earlier.is_dir() else 0
        return count + (self.state(run_key) != "missing")

    def new_raw(self, run_key: str) -> Path:
        """Returns an empty folder for the raw files of a run."""
        assert self.work is not None
        raw = self.work / run_key
        shutil.rmtree(raw, ignore_errors=True)
        if raw.exists():
            # Something of another user is in it, such as a container's; its name is still ours.
            raw.rename(tempfile.mkdtemp(prefix=f"{run_key}.", dir=self.work))
        raw.mkdir()
        # Nodes in containers run as another user and need access.
        raw.chmod(0o755)
        return raw

    def is_full(self) -> bool:
        """Returns whether the disk has no space for another run."""
        disk = os.statvfs(self.results)
        # File systems without an inode limit report 0 of 0.
        no_files = disk.f_files > 0 and disk.f_favail < FULL_FILES
        return disk.f_bavail * disk.f_frsize < FULL_BYTES or no_files

    def commit(self, run_key: str, raw: Path, replace: bool = False) -> None:
        """Converts a finished raw folder to its final form and adds it to the store atomically.

        An existing invalid attempt is kept as an earlier one. A valid run that a concurrent
        campaign has added stays, or becomes an earlier attempt with `replace`.
        """
        assert self.work is not None
        tidy = self.work / f"{run_key}.whole"
        shutil.rmtree(tidy, ignore_errors=True)
        (tidy / LOGS).mkdir(parents=True)
        for name, place in kept_of(raw).items():
            _move(raw / name, tidy / place)
        self.put(run_key, tidy, replace)
        shutil.rmtree(raw, ignore_errors=True)

    def put(self, run_key: str, tidy: Path, replace: bool = False) -> None:
        """Moves a finished folder from `work` into the store atomically."""
        for path in [*tidy.rglob("*"), tidy]:
            _flush(path)
        with _locked(self.results / WORK / LOCK):
            if replace or self.state(run_key) != "valid":
                self._set_aside(run_key)
                tidy.rename(self.runs / run_key)
                _flush(self.runs)
        shutil.rmtree(tidy, ignore_errors=True)

    def _set_aside(self, run_key: str) -> None:
        """Keeps an existing attempt under its number; removes a truncated one."""
        place = self.runs / run_key
        if self.state(run_key) == "missing":
            shutil.rmtree(place, ignore_errors=True)
            return
        kept = self.attempts / run_key
        kept.mkdir(parents=True, exist_ok=True)
        place.rename(kept / f"{sum(1 for _ in kept.iterdir()) + 1}")

    def remove(self, run_key: str) -> None:
        """Deletes a run with all its attempts. It is moved away first, because what is left of an
        interrupted removal must not count as a run. Raises SlambedError if it cannot be removed."""
        everybody = self.results / WORK
        try:
            everybody.mkdir(exist_ok=True)
            with _locked(everybody / LOCK):
                for folder in (self.runs / run_key, self.attempts / run_key):
                    if folder.is_dir():
                        place = Path(tempfile.mkdtemp(prefix="removed.", dir=everybody))
                        shutil.rmtree(folder.rename(place / run_key))
                        place.rmdir()
        except OSError as error:
            raise environment_error(
                f"cannot remove run {run_key}: {error.strerror}, {error.filename}; check the rights"
            ) from None


def kept_of(raw: Path) -> dict[str, str]:
    """Returns name in a raw folder -> name in the store, of all that is kept if it exists."""
    kept = {name: name for name in RESULT_FILES}
    kept |= {table.name: table.name for table in raw.glob("*.parquet")}
    kept |= {f"mobile/{name}": name for name in MOBILE_FILES}
    kept |= {name: f"{LOGS}/{name}" for name in ("run.json", "start.json", "log.txt")}
    kept |= {f"{role}/{name}": f"{LOGS}/{role}/{name}" for role in ROLES for name in NODE_FILES}
    if (raw / "link").is_dir():
        kept["link"] = f"{LOGS}/link"
    return kept


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Holds a lock, which the kernel releases even if this process is killed."""
    fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX)
        yield
    finally:
        os.close(fd)


def _is_locked(path: Path) -> bool:
    """Returns whether somebody holds the lock, or may hold it."""
    try:
        # Another user's file may be only readable, and NFS gives a reader only shared locks.
        fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    try:
        fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
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
    """Syncs a file's content, or a folder's entries, to disk."""
    fd = os.open(path, os.O_RDONLY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)
