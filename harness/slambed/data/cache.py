# SPDX-License-Identifier: Apache-2.0
"""A cache of prepared sequences, one folder per content key."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from slambed.data.places import making, no_cache
from slambed.data.preparation import Job, Notify, Progress
from slambed.data.prepared import SEQUENCE_FILE, PreparedSequence
from slambed.data.recipe import Dataset
from slambed.errors import SlambedError, environment_error
from slambed.files.json_file import read_object

_KEY_DIGITS = 12


class SequenceCache:
    """A folder of prepared sequences named <id>-<key>."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def get(
        self,
        dataset: Dataset,
        job: Job,
        progress: Progress | None,
        notify: Notify = lambda line: None,
    ) -> PreparedSequence:
        """Returns the sequence of this job from the cache, or prepares it now; `notify` is
        called before waiting."""
        path = self.folder / f"{dataset.id}-{job.key()[:_KEY_DIGITS]}"
        if (ready := open_or_none(path)) is not None:
            return ready
        with making(self.folder, dataset.id, f"prepares {dataset.id}", notify):
            if (ready := open_or_none(path)) is not None:
                return ready
            self._sweep(dataset.id)
            self._check_space(job)
            job.write(path, progress, notify)
            return PreparedSequence.open(path)

    def find(self, dataset: Dataset) -> Path | None:
        """Returns the newest cached sequence of the same recipe, even if its source is gone."""
        found = []
        for folder in self._entries(f"{dataset.id}-"):
            header = folder / SEQUENCE_FILE
            source = (read_object(header) or {}).get("source")
            if isinstance(source, dict) and source.get("recipe") == dataset.content_key():
                found.append((header.stat().st_mtime, folder))
        return max(found)[1] if found else None

    def of_checksum(self, checksum: str) -> PreparedSequence | None:
        """Returns the sequence with this content under any name; None if it is not on this
        machine."""
        for folder in self._entries(""):
            ready = open_or_none(folder)
            if ready is not None and ready.checksum == checksum:
                return ready
        return None

    def _entries(self, prefix: str) -> list[Path]:
        """Lists the entries with this prefix. It avoids glob(), which either treats an
        unreadable folder as empty or raises its own error, depending on the Python version."""
        try:
            with os.scandir(self.folder) as entries:
                return sorted(self.folder / e.name for e in entries if e.name.startswith(prefix))
        except FileNotFoundError:
            return []
        except OSError as refused:
            raise no_cache(self.folder, refused) from refused

    def _sweep(self, name: str) -> None:
        """Removes leftovers of killed preparations of this dataset; requires the lock."""
        for leftover in self.folder.glob(f".{name}-*.partial-*"):
            shutil.rmtree(leftover, ignore_errors=True)
        for leftover in self.folder.glob(f".{name}-*.old-*"):
            shutil.rmtree(leftover, ignore_errors=True)

    def _check_space(self, job: Job) -> None:
        needed, free = job.size_bytes(), shutil.disk_usage(self.folder).free
        if needed > free:
            raise environment_error(
                f"{self.folder}: {needed / 1e9:.1f} GB needed, {free / 1e9:.1f} GB free; "
                "free some or set SLAMBED_CACHE to another disk"
            )


def open_or_none(path: Path) -> PreparedSequence | None:
    """Returns None for a damaged entry, which is then prepared again."""
    try:
        if not path.is_dir():
            return None
    except OSError as refused:
        raise no_cache(path.parent, refused) from refused
    try:
        return PreparedSequence.open(path)
    except SlambedError:
        return None
