# SPDX-License-Identifier: Apache-2.0
"""Kept runs that are played again, and what is said where they differ."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import yaml
from command_line import refused, slambed
from virtual_parts import make_sequence, needs_programs, write_experiment

from slambed.campaign import plan
from slambed.campaign.datasets import Sequence, prepare_sequence
from slambed.campaign.folder import ResultFolder
from slambed.campaign.masks import Notify
from slambed.errors import ExitCode

RUNS = 4
"""Two systems, two runs each."""


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with walk.yaml and its results."""
    folder = tmp_path_factory.mktemp("played")
    file = write_experiment(folder, make_sequence(folder / "walk", 2))
    assert call("run", str(file), "--no-figures", *of(folder))[0] == ExitCode.OK
    return folder


def call(*arguments: str) -> tuple[int, str]:
    code, out, err = slambed(*arguments)
    return code, out + err


def of(folder: Path) -> tuple[str, str]:
    return "--results", str(folder / "results")


def replay(folder: Path, *more: str) -> tuple[int, str]:
    return call("results", "replay", str(folder / "walk.yaml"), *of(folder), *more)


@contextmanager
def put_back(file: Path) -> Iterator[None]:
    """Undoes what a test writes to a file that others read."""
    kept = file.read_bytes()
    try:
        yield
    finally:
        file.write_bytes(kept)


@needs_programs
def test_runs_played_again_are_the_same(played: Path) -> None:
    def there() -> list[tuple[Path, int, int]]:
        files = [path for path in (played / "results").rglob("*") if path.is_file()]
        return sorted((path, path.stat().st_mtime_ns, path.stat().st_size) for path in files)

    before = there()
    code, out = replay(played, "--runs", "2")
    assert code == ExitCode.OK, out
    assert "2 of 2 runs are the same, in " in out
    assert "2 not asked for" in out
    # At most as many as there are.
    code, out = replay(played, "--runs", "99", "--seed", "7")
    assert code == ExitCode.OK and f"{RUNS} of {RUNS} runs are the same" in out
    assert there() == before


@needs_programs
def test_packed_runs_are_played_again(played: Path, tmp_path: Path) -> None:
    file = str(tmp_path / "walk.tar.xz")
    code, out = call(
        "results", "pack", "walk", "-o", file, "--events", "keyframe_inserted", *of(played)
    )
    assert code == ExitCode.OK, out
    again = ("results", "replay", file, "--runs", str(RUNS))
    code, out = call(*again, "--experiment", str(played / "walk.yaml"))
    assert code == ExitCode.OK, out
    # The summary and the kept events of each.
    assert f"{RUNS} of {RUNS} runs are the same, in {2 * RUNS} files" in out
    assert "walk" in refused(ExitCode.BAD_INPUT, *again)
    other = ("--experiment", "quickstart")
    assert "has no runs of quickstart" in refused(ExitCode.BAD_INPUT, *again, *other)


@needs_programs
def test_what_differs_is_named(played: Path) -> None:
    store = ResultFolder(played / "results" / "walk").store
    first, second, *_ = store.keys()
    path = store.runs / first / "summary.json"
    kept = path.read_text()
    assert json.loads(kept)["ate_rmse_m"] > 0
    try:
        path.write_text(json.dumps(json.loads(kept) | {"ate_rmse_m": 7.0}))
        (store.runs / second / "of_older_sources.parquet").write_bytes(b"")
        code, out = replay(played)
    finally:
        path.write_text(kept)
        (store.runs / second / "of_older_sources.parquet").unlink()
    assert code == ExitCode.NOT_ALL_GOOD
    assert f"different: {first} (walk, " in out and "summary.json" in out
    assert "of_older_sources.parquet" in out
    assert f"{RUNS - 2} of {RUNS} runs are the same" in out and "2 differ" in out


@needs_programs
def test_last_digits_and_the_experiment_that_played_first_are_no_difference(played: Path) -> None:
    store = ResultFolder(played / "results" / "walk").store
    path = store.runs / store.keys()[0] / "summary.json"
    summary = json.loads(path.read_text())
    near = {"experiment": "stroll", "ate_rmse_m": summary["ate_rmse_m"] * (1 + 1e-13)}
    with put_back(path):
        path.write_text(json.dumps(summary | near))
        code, out = replay(played)
        assert code == ExitCode.OK, out
        assert f"{RUNS} of {RUNS} runs are the same" in out
        assert out.rstrip().endswith("accuracies of 1 have other last digits")
        path.write_text(json.dumps(summary | {"ate_rmse_m": summary["ate_rmse_m"] * (1 + 1e-6)}))
        assert replay(played)[0] == ExitCode.NOT_ALL_GOOD


@needs_programs
def test_runs_that_cannot_be_played_here_are_not_compared(played: Path) -> None:
    plan_file = played / "results" / "walk" / "experiment.json"
    content = json.loads(plan_file.read_text())
    with put_back(plan_file):
        for run in content["runs"]:
            run["software"] = "0.0.9+elsewhere"
        plan_file.write_text(json.dumps(content))
        code, out = replay(played, "--runs", "1")
        assert code == ExitCode.NOT_ALL_GOOD
        assert "not compared" in out and "made by 0.0.9+elsewhere, here is 0.1.0+" in out
    code, out = replay(played, "--runs", "1", "--set", "playback.fps=5")
    assert code == ExitCode.NOT_ALL_GOOD
    assert "plans no such run here: other settings or inputs" in out
    # The only line besides those of the runs.
    assert out.rstrip().endswith("walk.yaml: 0 of 1 runs are the same, in 0 files; 1 not compared")


@needs_programs
def test_only_the_datasets_of_the_drawn_runs_are_prepared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sequences = [make_sequence(tmp_path / name, 2, name=name) for name in ("walk", "stroll")]
    file = write_experiment(tmp_path, sequences[0])
    content = yaml.safe_load(file.read_text())
    content["datasets"] = list(map(str, sequences))
    file.write_text(yaml.safe_dump(content))
    assert call("run", str(file), "--no-figures", "--runs", "1", *of(tmp_path))[0] == ExitCode.OK
    prepared: list[str] = []

    def prepare(name: str, notify: Notify) -> Sequence:
        prepared.append(name)
        return prepare_sequence(name, notify)

    monkeypatch.setattr(plan, "prepare_sequence", prepare)
    code, out = replay(tmp_path, "--runs", "1")
    assert code == ExitCode.OK, out
    assert "1 of 1 runs are the same" in out
    assert len(prepared) == 1 and prepared[0] in map(str, sequences)


@needs_programs
def test_a_plan_that_is_not_whole_is_no_bug_of_ours(played: Path) -> None:
    plan_file = played / "results" / "walk" / "experiment.json"
    content = json.loads(plan_file.read_text())
    with put_back(plan_file):
        for run in content["runs"]:
            del run["run_key"]
        plan_file.write_text(json.dumps(content))
        line = refused(
            ExitCode.BAD_INPUT, "results", "replay", str(played / "walk.yaml"), *of(played)
        )
        assert "no valid virtual run of walk" in line


def test_nothing_to_play_again_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "results").mkdir()
    line = refused(ExitCode.BAD_INPUT, "results", "replay", "quickstart", *of(tmp_path))
    assert "no results of quickstart" in line
    line = refused(ExitCode.BAD_INPUT, "results", "replay", str(tmp_path / "no.tar.xz"))
    assert "cannot read" in line
    line = refused(ExitCode.BAD_INPUT, "results", "replay", "quickstart", "--experiment", "ramp")
    assert "--experiment is for packed files" in line
