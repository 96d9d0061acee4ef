# SPDX-License-Identifier: Apache-2.0
"""`slambed bisect`: the search, the rule, and a small real history in a clone."""

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from checkout import needs_history
from command_line import slambed
from results_factory import quickstart_like
from virtual_parts import make_sequence, needs_programs

from slambed.errors import SlambedError
from slambed.native import find_program, repository_root
from slambed.regression.bisect import Bisected, Commit, RegressionRule, SkippedError, bisect
from slambed.regression.candidates import RECORD, TREE, Repository, Workshop
from slambed.report.load import Results, load
from slambed.spec.software import STAMP

METRIC = "track_ms_median"


class History:
    """Commits that are slower from one commit on; some cannot be measured."""

    def __init__(self, base: Results, count: int, slow_from: int, broken: set[int]) -> None:
        self.base, self.slow_from, self.broken = base, slow_from, broken
        self.commits = [Commit(f"{i:040d}", f"change {i}") for i in range(count)]
        self.measured: list[int] = []

    def measure(self, commit: Commit) -> Results:
        number = int(commit.sha)
        self.measured.append(number)
        if number in self.broken:
            raise SkippedError("it does not build")
        runs = self.base.runs.copy()
        if number >= self.slow_from:
            runs[METRIC] = 1.5 * runs[METRIC].astype(float)
        return Results(self.base.folder, "title", runs, spec=self.base.spec)

    def search(self) -> Bisected:
        return bisect(self.commits[0], self.commits[1:], self, [METRIC])


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Results:
    results = load(quickstart_like(tmp_path_factory.mktemp("results"), 6, 6.0))
    results.runs["engine"] = "virtual"
    return results


@pytest.mark.parametrize("slow_from", [1, 2, 6, 19])
def test_the_first_slow_one_is_found_in_few_steps(base: Results, slow_from: int) -> None:
    history = History(base, 20, slow_from, set())
    found = history.search()
    assert [int(c.sha) for c in found.first] == [slow_from]
    assert "tracking, median" in found.why[0] and not found.skipped
    assert len(history.measured) == len(set(history.measured)) == found.tried <= 2 + 5


def test_skipped_ones_beside_the_answer_are_reported_with_it(base: Results) -> None:
    found = History(base, 12, 6, {5, 7, 8}).search()
    assert [int(c.sha) for c in found.first] == [5, 6]
    assert set(map(int, found.skipped)) >= {5}
    elsewhere = History(base, 12, 6, {1, 9}).search()
    assert [int(c.sha) for c in elsewhere.first] == [6]


def test_equal_ends_are_no_change_and_nothing_between_is_measured(base: Results) -> None:
    history = History(base, 12, 99, set())
    assert history.search() == Bisected(tried=2)
    assert history.measured == [0, 11]
    assert bisect(history.commits[0], [], history, []).first == []


def test_an_end_that_cannot_be_measured_is_an_error(base: Results) -> None:
    with pytest.raises(SlambedError, match=r"the bad commit 0+ cannot be measured: it does not"):
        bisect(Commit("1" * 40, "good"), [Commit("0" * 40, "bad")], History(base, 1, 9, {0}), [])


def test_what_cannot_get_worse_is_refused(base: Results) -> None:
    with pytest.raises(SlambedError, match=r"no metric 'track_ms_medan'.*did you mean"):
        RegressionRule(base, ["track_ms_medan"])
    with pytest.raises(SlambedError, match="no metric 'wall_s' that can get worse"):
        RegressionRule(base, ["wall_s"])
    nothing = Results(base.folder, "title", base.runs.assign(valid=False))
    with pytest.raises(SlambedError, match="no valid run"):
        RegressionRule(nothing, [])


EXPERIMENT = """\
id: walk
title: A short walk on a slow device
systems: [{{system: orbslam2}}]
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
devices:
  mobile: {{device: host, name: slow, cores: 1, speed: 0.2}}
engine: virtual
runs: {{default: 3}}
"""


class Clone:
    """A clone of this checkout to which commits are added."""

    def __init__(self, folder: Path) -> None:
        self.root = folder
        command = ["git", "clone", "-q", "--shared", str(repository_root()), str(folder)]
        subprocess.run(command, check=True)
        for key, value in (("user.name", "Test"), ("user.email", "test@invalid")):
            self.git("config", key, value)
        self.root_commit = self.head

    def git(self, *arguments: str) -> str:
        return Repository(self.root).git(*arguments)

    @property
    def head(self) -> str:
        return self.git("rev-parse", "HEAD")

    def change(self, subject: str, path: str, how: Callable[[str], str]) -> str:
        file = self.root / path
        before = file.read_text()
        file.write_text(how(before))
        assert file.read_text() != before, path
        self.git("commit", "-q", "-a", "-m", subject)
        return self.head

    def words(self, subject: str) -> str:
        """Commits a change that affects no run."""
        return self.change(subject, "README.md", lambda text: f"{text}\n{subject}\n")

    def features(self, count: int) -> str:
        """Commits another default, in a file that CMake does not track."""
        return self.change(
            f"Ask for {count} features",
            "systems/orbslam2/system.yaml",
            lambda text: re.sub(r"(n_orb:.*?default: )\d+", rf"\g<1>{count}", text, flags=re.S),
        )


@pytest.fixture
def clone(tmp_path: Path) -> Clone:
    return Clone(tmp_path / "clone")


@pytest.fixture
def workshop(clone: Clone, tmp_path: Path) -> Workshop:
    experiment = tmp_path / "walk.yaml"
    experiment.write_text(EXPERIMENT.format(sequence=make_sequence(tmp_path / "walk")))
    programs = tmp_path / "programs"
    programs.mkdir()
    for path in find_program("slambed-sim").parent.glob("slambed-*"):
        shutil.copy2(path, programs)
    completed = subprocess.run(
        ["python3", "-m", "slambed.spec.software"],
        env={"PYTHONPATH": str(clone.root / "harness"), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=True,
    )
    (programs / STAMP).write_text(completed.stdout)
    return Workshop(
        Repository(clone.root),
        tmp_path / "results" / "bisect" / "walk",
        experiment,
        3,
        programs=programs,
    )


def search(workshop: Workshop, good: str, bad: str, lines: list[str]) -> Bisected:
    repository, workshop.notify = workshop.repository, lines.append
    first, last = repository.commit(good), repository.commit(bad)
    with workshop.opened():
        return bisect(first, repository.after(first, last), workshop, [METRIC], notify=lines.append)


@needs_history
@needs_programs
@pytest.mark.nightly
def test_a_planted_default_is_found_and_what_was_measured_is_kept(
    clone: Clone, workshop: Workshop
) -> None:
    good = clone.head
    clone.words("Words before")
    clone.change(
        "Break the harness", "harness/slambed/commands/main.py", lambda text: "1 / 0\n" + text
    )
    clone.change(
        "Mend it", "harness/slambed/commands/main.py", lambda text: text.removeprefix("1 / 0\n")
    )
    planted = clone.features(2000)
    clone.words("Words behind")
    bad = clone.words("More words behind")
    lines: list[str] = []
    found = search(workshop, good, bad, lines)
    assert [c.sha for c in found.first] == [planted], lines
    assert "tracking, median" in found.why[0]
    # Equal sources and parameters share runs: three before the change, three after it.
    assert len(list((workshop.place / "runs").iterdir())) == 6
    assert not (workshop.place / TREE).exists() and "results" not in clone.git("worktree", "list")
    assert not any(line.startswith("building") for line in lines)
    for commit in (good, planted, bad):
        assert (workshop.place / commit[:12] / RECORD).is_file()
        assert len(load(workshop.place / commit[:12]).valid_runs) == 3

    # A second call checks nothing out; a results folder can name a commit.
    def refused(commit: Commit) -> None:
        raise AssertionError(commit)

    workshop._check_out = refused  # type: ignore[method-assign]
    again = search(workshop, str(workshop.place / good[:12]), bad, lines)
    assert [c.sha for c in again.first] == [planted]


@needs_history
@needs_programs
@pytest.mark.nightly
def test_equal_commits_show_no_change(clone: Clone, workshop: Workshop) -> None:
    good = clone.head
    clone.features(1500)
    clone.words("Between")
    text = clone.git("show", f"{good}:systems/orbslam2/system.yaml")
    bad = clone.change("Take it back", "systems/orbslam2/system.yaml", lambda _: text + "\n")
    lines: list[str] = []
    assert search(workshop, good, bad, lines).first == []
    assert any("no change for the worse" in line for line in lines)
    assert search(workshop, good, good, lines).first == []


BUILD = """\
#!/bin/bash
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
mkdir -p "$root/build/bin"
{before}
cp "{programs}"/slambed-* "$root/build/bin"
PYTHONPATH="$root/harness" python3 -m slambed.spec.software >"$root/build/bin/sources.sha256"
"""


@needs_history
@needs_programs
@pytest.mark.nightly
def test_commits_with_other_sources_are_built_by_their_own_script(
    clone: Clone, workshop: Workshop
) -> None:
    """Compiling takes minutes, so here the commits' script copies compiled programs."""
    good = clone.head
    script = BUILD.format(before="", programs=workshop.programs)
    clone.change("Copy instead of compiling", "tools/build.sh", lambda _: script)
    other = clone.change("Other sources", "docker/Dockerfile", lambda text: text + "# other\n")
    broken = BUILD.format(before='echo "error: no compiler" >&2; exit 3', programs="/nowhere")
    clone.change("Break the build", "tools/build.sh", lambda _: broken)
    failing = clone.change("New sources", "docker/Dockerfile", lambda text: text + "# new\n")
    clone.change("Mend the build", "tools/build.sh", lambda _: script)
    planted = clone.features(2000)
    lines: list[str] = []
    found = search(workshop, good, planted, lines)
    assert [c.sha for c in found.first] == [planted], lines
    built = [line for line in lines if line.startswith("building")]
    assert any(planted[:12] in line for line in built)
    kept = {path.name for path in (workshop.place / "programs").iterdir()}
    assert (workshop.place / "logs" / f"{planted[:12]}.txt").is_file() and kept
    # A commit whose build fails is skipped with a line of its build as the reason.
    with workshop.opened(), pytest.raises(SkippedError, match=r"does not build: no compiler \(all"):
        workshop.measure(Commit(failing, "New sources"))
    with workshop.opened():
        assert len(workshop.measure(Commit(other, "Other sources")).valid_runs) == 3


BAD_CALLS = {
    "no such commit": (["--good", "no_such_tag"], "no commit 'no_such_tag'"),
    "not on the way": (["--good", "HEAD", "--bad", "HEAD~1"], "HEAD"),
    "too few runs": (["--good", "HEAD", "--set", "runs.default=1"], "too few to compare"),
    "unknown experiment": (["--good", "HEAD"], "unknown experiment"),
}


@needs_history
@pytest.mark.parametrize("case", BAD_CALLS)
def test_bad_input_is_one_line(case: str, tmp_path: Path) -> None:
    arguments, expected = BAD_CALLS[case]
    name = "quickstarted" if case == "unknown experiment" else "quickstart"
    code, _, err = slambed("bisect", name, *arguments, "--results", str(tmp_path / "results"))
    assert code == 2 and err.count("\n") == 1 and err.startswith("error: ")
    if case == "not on the way":
        assert "is not on the way to" in err or "give a good commit" in err
    else:
        assert expected in err, err


@needs_history
def test_a_results_folder_stands_for_the_one_clean_commit_of_its_runs(tmp_path: Path) -> None:
    folder = quickstart_like(tmp_path, 2, 6.0)
    repository = Repository(repository_root())
    manifests = sorted(folder.glob("runs/*/manifest.json"))

    def are_of(commit: str, which: list[Path], dirty: bool = False) -> None:
        for path in which:
            content = json.loads(path.read_text()) | {"commit": commit, "dirty": dirty}
            path.write_text(json.dumps(content))

    head = repository.git("rev-parse", "HEAD")
    are_of(head, manifests)
    assert repository.commit(str(folder)).sha == head
    are_of(head, manifests[:1], dirty=True)
    with pytest.raises(SlambedError, match="changes that were not committed"):
        repository.commit(str(folder))
    are_of("0" * 40, manifests[:1])
    with pytest.raises(SlambedError, match="are of 2 commits; give the commit itself"):
        repository.commit(str(folder))


def test_a_cell_is_named_as_commits_of_before_name_it() -> None:
    words = ("--good", "HEAD", "--only", "system=edgeslam")
    code, out, err = slambed("bisect", "quickstart", *words)
    assert (code, out) == (
        2,
        "",
    ) and "--only system=edgeslam: bisect takes the name of a combination" in err
