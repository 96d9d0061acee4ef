# SPDX-License-Identifier: Apache-2.0
"""results/<experiment>/: a view of the runs in the experiment's plans, and its reports.

`runs/` holds a link per run to its folder in the store, so readers of an experiment need not know
the store. A run that leaves a plan or returns to it is not executed again.
"""

import json
import shutil
from collections.abc import Iterable
from pathlib import Path

from slambed.campaign.store import STORE, RunStore, State
from slambed.errors import environment_error
from slambed.files.atomic import replacing
from slambed.metrics.summary import Summary
from slambed.records.manifest import Manifest


class ResultFolder:
    """The results of one experiment, as a view of the store in the parent folder."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.runs = path / STORE
        self.store = RunStore(path.parent)

    def create(self) -> None:
        """Creates the folders and opens the store."""
        self.store.open()
        try:
            self.runs.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise environment_error(
                f"cannot write results: {error.strerror}, {self.path}"
            ) from None
        self._adopt()

    def close(self) -> None:
        """Removes temporary files of the store."""
        self.store.close()

    def _adopt(self) -> None:
        """Moves runs from versions without a store into it."""
        for old in (self.runs, self.path / "stale"):
            for folder in old.iterdir() if old.is_dir() else ():
                place = self.store.runs / folder.name
                if folder.is_dir() and not folder.is_symlink() and not place.exists():
                    folder.rename(place)
                    if old == self.runs:
                        self._link(folder.name)
        shutil.rmtree(self.path / ".work", ignore_errors=True)

    def state(self, run_key: str) -> State:
        """Returns the state of a run, whichever experiment executed it."""
        return self.store.state(run_key)

    def summary(self, run_key: str) -> Summary | None:
        """Returns the summary of a run; None if it is missing or truncated."""
        return self.store.summary(run_key)

    def manifest(self, run_key: str) -> Manifest | None:
        """Returns the manifest of a run; None if it is missing or truncated."""
        return self.store.manifest(run_key)

    def run_keys(self) -> list[str]:
        """Keys of the runs in this view."""
        if not self.runs.is_dir():
            return []
        return sorted(p.name for p in self.runs.iterdir() if p.is_dir())

    def show(self, run_keys: Iterable[str]) -> None:
        """Makes the view show exactly these runs, as far as they exist."""
        wanted = set(run_keys)
        for link in list(self.runs.iterdir()):
            if link.is_symlink() and (link.name not in wanted or not link.exists()):
                link.unlink()
        for key in wanted:
            if self.store.state(key) != "missing":
                self._link(key)

    def _link(self, run_key: str) -> None:
        link = self.runs / run_key
        if not link.is_symlink() and not link.exists():
            link.symlink_to(Path("..") / ".." / STORE / run_key)

    def new_raw(self, run_key: str) -> Path:
        """Returns an empty folder for the raw files of a run."""
        return self.store.new_raw(run_key)

    def is_full(self) -> bool:
        """Returns whether the disk has no space for another run."""
        return self.store.is_full()

    def commit(self, run_key: str, raw: Path, replace: bool = False) -> None:
        """Adds a finished run to the store and to this view; `replace` also replaces a valid
        run."""
        self.store.commit(run_key, raw, replace)
        self._link(run_key)

    def write_json(self, name: str, content: object) -> None:
        """Writes a file of the experiment atomically."""
        with replacing(self.path / name, durable=True) as out:
            out.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n")
