# SPDX-License-Identifier: Apache-2.0
"""Checks out, builds and measures commits with their own harness, each once."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from slambed.data.places import search_path
from slambed.engines.host_lock import STOP, host_lock
from slambed.errors import ExitCode, SlambedError, environment_error
from slambed.files.json_file import object_or_empty
from slambed.regression.bisect import Commit, Notify, SkippedError
from slambed.report.load import Results, load
from slambed.report.recompute import recompute_refused
from slambed.spec.software import STAMP

TREE, PROGRAMS, LOGS, RECORD = "tree", "programs", "logs", "bisect.json"
COMMAND = """\
try:
    from slambed.commands.main import main
except ModuleNotFoundError:
    from slambed.cli import main
main()
"""
"""The second import is for commits older than the package `commands`."""
RAN = (ExitCode.OK, ExitCode.NOT_ALL_GOOD)
"""Exit codes of `slambed run` with a result; runs that did not complete are a result too."""


class Repository:
    """A git checkout."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def git(self, *arguments: str) -> str:
        """Returns git's output. Raises SlambedError with its last line of stderr if it fails."""
        command = ["git", "-C", str(self.root), *arguments]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError as error:
            raise environment_error(f"git: {error.strerror}; bisect needs it") from None
        if done.returncode:
            raise SlambedError(f"git {arguments[0]}: {_last(done.stderr)}")
        return done.stdout.strip()

    def commit(self, name: str) -> Commit:
        """Returns a commit by name, or the one commit of all runs in a results folder."""
        if (Path(name) / "runs").is_dir():
            name = _commit_of(Path(name))
        try:
            sha = self.git("rev-parse", "--verify", "--quiet", f"{name}^{{commit}}")
        except SlambedError:
            raise SlambedError(
                f"no commit '{name}' in {self.root}; give a commit, a tag or a results folder"
            ) from None
        return Commit(sha, self.git("log", "-1", "--format=%s", sha))

    def after(self, good: Commit, bad: Commit) -> list[Commit]:
        """Returns the commits after `good` up to `bad`, oldest first. A merge counts as one commit
        (first parents)."""
        if good.sha == bad.sha:
            return []
        listed = self.git(
            *("log", "--first-parent", "--reverse", "--format=%H %s"),
            f"{good.sha}..{bad.sha}",
        ).splitlines()
        found = [Commit(sha, subject) for sha, _, subject in (x.partition(" ") for x in listed)]
        first = self.git("rev-parse", f"{found[0].sha}^") if found else ""
        if first != good.sha:
            raise SlambedError(
                f"{good.short} is not on the way to {bad.short} (first parents); give a good "
                "commit that the bad one was made from"
            )
        return found


@dataclass
class Workshop:
    """Measures commits in `place`. It stores their runs (`runs/`), a results folder per commit, the
    programs per state of the sources, and build logs."""

    repository: Repository
    place: Path
    experiment: Path
    """The current experiment file, used for every commit."""
    runs: int
    settings: Sequence[str] = ()
    only: Sequence[str] = ()
    programs: Path | None = None
    """Built programs with their stamp, reused for commits with the same sources."""
    notify: Notify = field(default=lambda line: None)

    @contextmanager
    def opened(self) -> Iterator["Workshop"]:
        """Holds the lock of `place`, and removes the worktree at both ends."""
        self.place.mkdir(parents=True, exist_ok=True)
        with host_lock(
            f"slambed bisect {self.experiment.stem}",
            self.place / ".lock",
            conflict=f"another bisect works in {self.place}",
            advice=STOP,
        ):
            self._remove_tree()  # left by a killed bisect
            try:
                yield self
            finally:
                self._remove_tree()

    @property
    def tree(self) -> Path:
        return self.place / TREE

    @property
    def question(self) -> str:
        """Returns the digest of experiment file, runs and options; other ones are measured
        again."""
        asked = [self.experiment.read_text(), self.runs, list(self.settings), list(self.only)]
        return hashlib.sha256(json.dumps(asked).encode()).hexdigest()

    def measure(self, commit: Commit) -> Results:
        """Returns the runs of a commit, from an earlier bisect if its question was the same."""
        folder = self.place / commit.short
        if object_or_empty(folder / RECORD).get("question") != self.question:
            self._check_out(commit)
            self._build(commit)
            self._run(commit, folder)
        recompute_refused(folder)
        return load(folder)

    def _check_out(self, commit: Commit) -> None:
        if (self.tree / ".git").exists():
            Repository(self.tree).git("checkout", "--quiet", "--force", "--detach", commit.sha)
        else:
            self.repository.git(
                "worktree", "add", "--quiet", "--detach", "--force", str(self.tree), commit.sha
            )

    def _build(self, commit: Commit) -> None:
        """Builds with the commit's own tools/build.sh, which does nothing if programs of its
        sources exist."""
        completed = self._call([sys.executable, "-P", "-m", "slambed.spec.software"], cwd=self.tree)
        digest = completed.stdout.strip()
        if completed.returncode or not digest.isalnum():
            raise SkippedError(f"its sources are unknown: {_last(completed.stderr)}")
        into, kept = self.tree / "build" / "bin", self.place / PROGRAMS / digest
        there = filter(None, (kept, self.programs))
        known = [folder for folder in there if _stamp(folder) == digest]
        if known and _stamp(into) != digest:
            _copy(known[0], into)
        if _stamp(into) != digest:
            self.notify(f"building {commit.short}, sources {digest}")
        log = self.place / LOGS / f"{commit.short}.txt"
        log.parent.mkdir(exist_ok=True)
        done = self._call([str(self.tree / "tools" / "build.sh"), "virtual"], cwd=self.tree)
        log.write_text(done.stdout + done.stderr)
        if done.returncode or _stamp(into) != digest:
            why = _last(done.stderr or done.stdout)
            raise SkippedError(f"it does not build: {why} (all of it: {log})")
        if not known:
            _copy(into, kept)

    def _run(self, commit: Commit, folder: Path) -> None:
        arguments = [
            *("run", str(self.experiment), "--engine", "virtual", "--runs", str(self.runs)),
            *("--results", str(self.place), "--no-figures", "--keep-going"),
            *(word for text in self.settings for word in ("--set", text)),
            *(word for cell in self.only for word in ("--only", cell)),
        ]
        done = self._call([sys.executable, "-P", "-c", COMMAND, *arguments], cwd=Path.cwd())
        made = self.place / self.experiment.stem
        if done.returncode not in RAN or not (made / "runs").is_dir():
            raise SkippedError(f"its harness does not run it: {_last(done.stderr)}")
        shutil.rmtree(folder, ignore_errors=True)  # links to runs of another question
        made.rename(folder)
        record = {"commit": commit.sha, "subject": commit.subject, "question": self.question}
        (folder / RECORD).write_text(json.dumps(record, indent=1) + "\n")

    def _call(self, command: list[str], cwd: Path) -> subprocess.CompletedProcess[str]:
        environment = {k: v for k, v in os.environ.items() if k != "SLAMBED_BIN"} | {
            "PYTHONPATH": str(self.tree / "harness"),
            # The worktree would not find recordings next to this checkout.
            "SLAMBED_DATA": ":".join(map(str, search_path())),
            "CCACHE_BASEDIR": str(self.tree),
            "CCACHE_NOHASHDIR": "1",
        }
        try:
            return subprocess.run(
                command, cwd=cwd, env=environment, capture_output=True, text=True, check=False
            )
        except OSError as error:
            return subprocess.CompletedProcess(command, 1, "", f"{command[0]}: {error.strerror}")

    def _remove_tree(self) -> None:
        if self.tree.exists():
            self.repository.git("worktree", "remove", "--force", "--force", str(self.tree))
        self.repository.git("worktree", "prune")


def _commit_of(folder: Path) -> str:
    facts = load(folder).facts
    commits, dirty = facts["commit"], facts["dirty"]
    if len(commits) != 1:
        what = "no commit" if not commits else f"{len(commits)} commits"
        raise SlambedError(f"the runs of {folder} are of {what}; give the commit itself")
    if "True" in dirty:
        raise SlambedError(
            f"runs of {folder} were made with changes that were not committed; give a commit"
        )
    return next(iter(commits))


def _stamp(folder: Path) -> str:
    path = folder / STAMP
    return path.read_text().strip() if path.is_file() else ""


def _copy(source: Path, target: Path) -> None:
    """Copies programs and the stamp last, so that an incomplete copy has no stamp."""
    target.mkdir(parents=True, exist_ok=True)
    (target / STAMP).unlink(missing_ok=True)
    for path in source.glob("slambed-*"):
        (target / path.name).unlink(missing_ok=True)
        shutil.copy2(path, target / path.name)
    shutil.copy2(source / STAMP, target / STAMP)


def _last(text: str) -> str:
    """Returns the last `error:` line, else the last line."""
    lines = text.strip().splitlines()
    error_lines = [line.removeprefix("error: ") for line in lines if line.startswith("error:")]
    return (error_lines or lines or ["it printed nothing"])[-1]
