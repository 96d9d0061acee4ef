# SPDX-License-Identifier: Apache-2.0
"""`slambed status` and `slambed run` find the same runs, also for a file that never ran or has
changed since."""

import json
import re
from pathlib import Path

import pytest
from command_line import slambed
from virtual_parts import EXPERIMENT, make_sequence, needs_programs, write_experiment

from slambed.errors import ExitCode

pytestmark = needs_programs


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Returns an experiment of two cells with one executed run each."""
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    path = write_experiment(tmp_path, make_sequence(tmp_path / "walk", 1), runs=1)
    code, _, err = slambed("run", str(path), "--no-figures")
    assert code == ExitCode.OK, err
    return path


def test_a_look_deletes_nothing(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pruned: list[Path] = []
    monkeypatch.setattr("slambed.campaign.run_experiment.prune_features", pruned.append)
    run_finds(path)
    assert pruned == []
    slambed("run", str(path), "--no-figures")
    assert len(pruned) == 1


def run_finds(path: Path) -> tuple[int, int]:
    """Returns the existing runs, and those that `slambed run` would execute."""
    code, out, err = slambed("run", str(path), "--dry-run")
    assert code == ExitCode.OK, err
    there = sum(int(n) for n in re.findall(r": (\d+) of \d+ runs there", out))
    (todo,) = re.findall(r"(\d+) runs to execute", out)
    return there, int(todo)


def status_finds(named: str, expected: int = 1) -> tuple[tuple[int, int], list[str]]:
    code, out, err = slambed("status", named, "--json")
    assert code == expected, err
    found = json.loads(out)
    assert found["complete"] is (expected == 0)
    there = sum(cell["valid"] + len(cell["invalid"]) for cell in found["cells"])
    return (there, sum(cell["missing"] for cell in found["cells"])), found["notes"]


def test_of_a_new_experiment_the_runs_that_others_made_count(path: Path, tmp_path: Path) -> None:
    new = tmp_path / "again.yaml"
    new.write_text(
        path.read_text().replace("id: walk", "id: again").replace("default: 1", "default: 2")
    )
    assert run_finds(new) == (2, 2)
    found, notes = status_finds(str(new))
    assert found == (2, 2)
    assert notes[0] == f"not run yet: 2 of 4 runs; start with 'slambed run {new}'"
    assert "other experiments asked for the same runs" in notes[1]


def test_of_a_changed_experiment_the_file_counts_and_not_what_was_run(
    path: Path, tmp_path: Path
) -> None:
    assert status_finds(str(path), expected=0) == ((2, 0), [])
    # The set of run keys changes: one cell plays another sequence, the other has more seeds.
    path.write_text(
        path.read_text()
        .replace("sync_period_s: 0.5", "sync_period_s: 0.7")
        .replace("default: 1", "default: 2")
    )
    assert run_finds(path) == (1, 3)
    found, notes = status_finds(str(path))
    assert found == (1, 3)
    assert notes == [
        f"walk.yaml has changed since it was run: 1 of 4 runs; start with 'slambed run {path}'"
    ]
    # A comment changes no run.
    path.write_text(EXPERIMENT.format(sequence=tmp_path / "walk", runs=1) + "# as before\n")
    assert run_finds(path) == (2, 0)
    assert status_finds(str(path), expected=0)[0] == (2, 0)
    code, out, _ = slambed("status", str(path))
    assert code == ExitCode.OK and "note: walk.yaml has changed" in out


def test_of_another_file_with_the_same_name_too(path: Path, tmp_path: Path) -> None:
    other = tmp_path / "elsewhere" / "walk.yaml"
    other.parent.mkdir()
    other.write_text(path.read_text().replace("sync_period_s: 0.5", "sync_period_s: 0.9"))
    assert status_finds(str(other))[0] == run_finds(other) == (1, 1)
    assert status_finds("walk", expected=0)[0] == (2, 0)


def test_what_hangs_on_something_that_is_not_made_is_not_guessed(
    path: Path, tmp_path: Path
) -> None:
    new = tmp_path / "again.yaml"
    text = path.read_text().replace("id: walk", "id: again")
    new.write_text(text.replace(f"[{tmp_path / 'walk'}]", "[synthetic_room]"))
    code, out, err = slambed("status", str(new))
    assert code == ExitCode.OK, err
    assert (
        "not run yet: which of 2 runs are there is not known (dataset synthetic_room is not" in out
    )
    assert f"'slambed run {new} --dry-run'" in out
    assert not (tmp_path / "cache" / "prepared").exists()
