# SPDX-License-Identifier: Apache-2.0
"""results/<experiment>/: a view of the runs that the experiment's plans name, and its reports.

`runs/` holds a link per run to its place in the store, so what reads an experiment needs to know
nothing of the store; to leave a plan or to come back to it costs no run anything.
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
    """The results of one experiment, over the store that lies beside it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.runs = path / STORE
        self.store = RunStore(path.parent)

    def create(self) -> None:
        """Makes the folders; `store.open` beside it."""
        self.store.open()
        try:
            self.runs.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise environment_error(
                f"cannot write results: {error.strerror}, {self.path}"
            ) from None
        self._adopt()

    def close(self) -> None:
        """Leaves nothing but results."""
        self.store.close()

    def _adopt(self) -> None:
        """Runs of the time before there was a store get their place in it."""
        for old in (self.runs, self.path / "stale"):
            for folder in old.iterdir() if old.is_dir() else ():
                place = self.store.runs / folder.name
                if folder.is_dir() and not folder.is_symlink() and not place.exists():
                    folder.rename(place)
                    if old == self.runs:
                        self._link(folder.name)
        shutil.rmtree(self.path / ".work", ignore_errors=True)

    def state(self, run_key: str) -> State:
        """What is there of a run, whoever executed it."""
        return self.store.state(run_key)

    def summary(self, run_key: str) -> Summary | None:
        """Of a run; None when it is not there or not whole."""
        return self.store.summary(run_key)

    def manifest(self, run_key: str) -> Manifest | None:
        """Of a run; None when it is not there or not whole."""
        return self.store.manifest(run_key)

    def run_keys(self) -> list[str]:
        """Runs in this view."""
        if not self.runs.is_dir():
            return []
        return sorted(p.name for p in self.runs.iterdir() if p.is_dir())

    def show(self, run_keys: Iterable[str]) -> None:
        """Makes the view one of these runs, as far as they are there."""
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
        """An empty folder for the raw files of a run."""
        return self.store.new_raw(run_key)

    def is_full(self) -> bool:
        """Whether the disk has no room for one more run."""
        return self.store.is_full()

    def commit(self, run_key: str, raw: Path, replace: bool = False) -> None:
        """A finished run into the store and this view; `replace`: in the place of any other."""
        self.store.commit(run_key, raw, replace)
        self._link(run_key)

    def write_json(self, name: str, content: object) -> None:
        """A file of the experiment, replaced by one rename."""
        with replacing(self.path / name, durable=True) as out:
            out.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n")
