# SPDX-License-Identifier: Apache-2.0
"""The kept runs of papers: their pages without a run, beside results and never in them."""

import json
import re
import subprocess
from collections import Counter
from pathlib import Path

import pytest
from checkout import needs_history
from command_line import refused, slambed
from results_factory import quickstart_like

from slambed.campaign.pack import pack
from slambed.errors import ExitCode, SlambedError
from slambed.native import repository_root
from slambed.papers import kept, origin
from slambed.papers.kept import MARKER, no_runs_words, read_kept
from slambed.papers.origin import UNKNOWN, is_known, origin_words
from slambed.report.load import Results, load


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    """Returns a results folder with one experiment, whose runs lie in the store."""
    folder = quickstart_like(tmp_path / "results", repetitions=2, duration_s=3.0)
    store = folder.parent / "runs"
    store.mkdir()
    for run in list((folder / "runs").iterdir()):
        run.rename(store / run.name)
        run.symlink_to(Path("..") / ".." / "runs" / run.name)
    runs = [{"run_key": run.name} for run in sorted(store.iterdir())]
    (folder / "experiment.json").write_text(json.dumps({"experiment": {}, "runs": runs}))
    return folder


@pytest.fixture
def archive(stored: Path, tmp_path: Path) -> Path:
    file = tmp_path / "runs.tar.xz"
    pack(stored.parent, [stored.name], file, whole=False)
    return file


def numbers(results: Results) -> list[tuple[str, float]]:
    runs = results.valid_runs.sort_values("run_key")
    return list(zip(runs["run_key"], runs["ate_rmse_m"], strict=True))


def test_kept_runs_have_the_numbers_that_were_packed(
    stored: Path, archive: Path, tmp_path: Path
) -> None:
    found = read_kept(archive, tmp_path / "kept")
    assert [results.name for results in found] == [stored.name]
    assert numbers(found[0]) == numbers(load(stored))
    assert len(found[0].valid_runs) > 0


def test_an_archive_is_extracted_once_and_again_after_it_changed(
    stored: Path, archive: Path, tmp_path: Path
) -> None:
    place = tmp_path / "kept"
    read_kept(archive, place)
    (place / "left").touch()
    read_kept(archive, place)
    assert (place / "left").exists()
    run = next((stored.parent / "runs").iterdir())
    (run / "summary.json").unlink()
    pack(stored.parent, [stored.name], archive, whole=False)
    found = read_kept(archive, place)
    assert not (place / "left").exists()
    assert run.name not in set(found[0].runs["run_key"])


def test_a_torn_archive_is_refused_and_tried_again(archive: Path, tmp_path: Path) -> None:
    whole = archive.read_bytes()
    archive.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(SlambedError, match=r"runs\.tar\.xz is torn"):
        read_kept(archive, tmp_path / "kept")
    assert not (tmp_path / "kept" / MARKER).exists()
    archive.write_bytes(whole)
    assert len(read_kept(archive, tmp_path / "kept")) == 1


def test_the_pages_need_no_results_and_run_nothing(tmp_path: Path) -> None:
    code, out, err = slambed("papers", "kept", "multithread_rl", "cloudslam", cwd=tmp_path)
    assert (code, err) == (0, "")
    pages = tmp_path / "results" / "papers" / "kept"
    html = (pages / "multithread_rl" / "index.html").read_text()
    assert "commit 393db60, 474bf7b" in html and "played 2026-11-27" in html
    assert "slambed papers kept multithread_rl" in html
    # Figures of single events are drawn from the events that were kept.
    html = (pages / "cloudslam" / "index.html").read_text()
    assert "<h2>Fig. 12, virtual</h2>" in html and "<h2>Fig. 18, virtual</h2>" in html
    assert "13 of 17 orderings hold" in out
    assert sorted(path.name for path in (tmp_path / "results").iterdir()) == ["papers"]


def outcomes(page: str) -> dict[tuple[str, bool], str]:
    """(O07, live) -> outcome, of a page as Markdown."""
    found = {}
    for part in page.split("\n## Declared orderings of ")[1:]:
        heading, _, table = part.partition("\n\n## ")[0].partition("\n")
        live = "(virtual)" not in heading
        for row in table.splitlines():
            cells = [cell.strip() for cell in row.strip("|").split(" | ")]
            if match := re.fullmatch(r"\w+\.(O\d\d)", cells[0]):
                found[match[1], live] = cells[4]
    return found


@pytest.mark.parametrize("name", ["cloudslam", "dynnetslam", "multithread_rl"])
def test_the_papers_documentation_has_the_outcomes_of_its_packed_runs(
    name: str, tmp_path: Path
) -> None:
    assert slambed("papers", "kept", name, "--out", str(tmp_path))[0] == 0
    page = (tmp_path / name / "page.md").read_text()
    of_page = outcomes(page)
    text = (repository_root() / "docs" / "papers" / f"{name}.md").read_text()
    rows = re.findall(r"^\| (O\d\d.*?) \| (.*?) \| (.*?) \|$", text, re.MULTILINE)
    assert len(rows) > 8
    for what, outcome, ours in rows:
        names = what.partition(":")[0]
        numbers = {int(number) for number in re.findall(r"O(\d\d)", names)}
        for first, last in re.findall(r"O(\d\d) to O(\d\d)", names):
            numbers |= set(range(int(first), int(last) + 1))
        said = re.sub(r"^hold\b", "holds", re.split(r"[,(]", outcome)[0].strip())
        for number in numbers:
            found = of_page[f"O{number:02}", ", live" in outcome]
            assert found.partition(",")[0] == said, what
        for counts, runs in re.findall(r"((?:\d+, )+\d+) of (\d+)", ours):
            missing = [n for n in counts.split(", ") if f"{n}/{runs}" not in page]
            assert not missing, f"{what}: {ours}"


def test_the_numbers_of_packed_runs_are_counted(tmp_path: Path) -> None:
    code, out, err = slambed("papers", "counts", "cloudslam", "--packed", "--json", cwd=tmp_path)
    assert (code, err) == (0, "")
    counted = json.loads(out)["cloudslam"]
    assert counted["printed"] == 48 and counted["groups"]["beside"] > 0
    assert counted["without"]["not_played"] == 0
    assert not list(tmp_path.iterdir())
    line = refused(ExitCode.BAD_INPUT, "papers", "counts", "--packed", "--results", str(tmp_path))
    assert "leave out --results" in line


def test_the_page_of_all_papers_has_the_counts_of_the_packed_runs(tmp_path: Path) -> None:
    code, out, _ = slambed("papers", "counts", "--packed", cwd=tmp_path, COLUMNS="200")
    assert code == 0
    counted = [re.split(r"\s{2,}", line.strip()) for line in out.splitlines()[2:]]
    text = (repository_root() / "docs" / "papers" / "index.md").read_text()
    rows = re.findall(r"^\| (.+?) \| (\d+(?: \| \d+){4}) \|$", text, re.MULTILINE)
    page = [[what, *numbers.split(" | ")] for what, numbers in rows]
    assert page == [row for row in counted if row[-1] != "0"]


def test_a_program_has_no_kept_runs(tmp_path: Path) -> None:
    line = refused(ExitCode.BAD_INPUT, "papers", "kept", "peer_orbslam2", cwd=tmp_path)
    assert line == "error: peer_orbslam2: no paper, so no runs are kept"


def test_a_page_without_runs_says_whether_some_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept, "papers_folder", lambda: tmp_path)
    assert no_runs_words("mine") == "no runs yet; none are kept in papers/mine/runs.tar.xz"
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "runs.tar.xz").touch()
    assert no_runs_words("mine").endswith("shown by slambed papers kept mine")


def test_a_commit_that_git_does_not_know_is_said(
    stored: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    results = load(stored)
    results.facts["commit"] = Counter({"a" * 40: 1, "b" * 40: 1})
    results.facts["dirty"] = Counter({"False": 2})
    results.runs["started_utc"] = "2026-11-24T23:59:00.000+00:00"
    results.runs.loc[results.runs.index[-1], "started_utc"] = "2026-11-25T00:10:00.000+00:00"
    monkeypatch.setattr(origin, "is_known", lambda commit: commit.startswith("a"))
    played = "played 2026-11-24 to 2026-11-25"
    assert origin_words([results]) == [f"commit aaaaaaa, bbbbbbb (bbbbbbb {UNKNOWN})", played]
    monkeypatch.setattr(origin, "is_known", lambda commit: False)
    assert origin_words([results])[0] == f"commit aaaaaaa, bbbbbbb ({UNKNOWN})"
    monkeypatch.setattr(origin, "is_known", lambda commit: True)
    assert origin_words([results])[0] == "commit aaaaaaa, bbbbbbb"


@needs_history
def test_git_knows_its_own_commits() -> None:
    git = ["git", "-C", str(repository_root()), "rev-parse"]
    head, shallow = (
        subprocess.run([*git, what], capture_output=True, text=True, check=True).stdout.strip()
        for what in ("HEAD", "--is-shallow-repository")
    )
    if shallow == "true":
        pytest.skip("a shallow clone")
    assert is_known(head)
    assert not is_known("0" * 39 + "1")
