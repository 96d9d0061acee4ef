# SPDX-License-Identifier: Apache-2.0
"""The results folder: complete or missing runs, attempts, views and the ledger."""

import errno
import json
import os
import re
import shutil
from pathlib import Path

import pytest
from command_line import refused, slambed
from harness_parts import (
    run_spec,
    specs,
)

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.runs_beyond_plan import valid_repetitions
from slambed.campaign.status import status_of
from slambed.campaign.store import RunStore
from slambed.errors import ExitCode, SlambedError
from slambed.spec.library import Library
from slambed.spec.run_spec import RunSpec


def finished(folder: ResultFolder, spec: RunSpec, valid: bool = True) -> None:
    raw = folder.new_raw(spec.run_key)
    (raw / "manifest.json").write_text(json.dumps({"spec": spec.model_dump(mode="json")}))
    (raw / "summary.json").write_text(json.dumps({"valid": valid, "invalid_reason": "why"}))
    folder.commit(spec.run_key, raw)


def test_ledger_survives_a_torn_line(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path / "ledger.jsonl")
    assert ledger.read() == []
    ledger.append("run_started", run_key="a")
    with ledger.path.open("a") as out:
        out.write('{"event": "run_fini')
    ledger.append("run_started", run_key="a")
    assert [entry["event"] for entry in ledger.read()] == ["run_started"] * 2
    assert ledger.attempts("a") == 2


def test_a_run_folder_is_whole_or_missing(tmp_path: Path) -> None:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    spec = run_spec()
    key = spec.run_key
    assert folder.state(key) == "missing"
    raw = folder.new_raw(key)
    (raw / "manifest.json").write_text("{}")
    (raw / "summary.json").write_text('{"valid": true}')
    (raw / "mobile").mkdir()
    (raw / "mobile" / "trajectory.txt").write_text("0 0 0 0 0 0 0 1\n")
    (raw / "mobile" / "log.txt").write_text("hello\n")
    (raw / "events.parquet").write_bytes(b"x")
    assert folder.state(key) == "missing"
    folder.commit(key, raw)
    assert folder.state(key) == "valid"
    place = folder.runs / key
    found = sorted(p.relative_to(place).as_posix() for p in place.rglob("*") if p.is_file())
    assert found == [
        "events.parquet",
        "manifest.json",
        "nodes/mobile/log.txt",
        "summary.json",
        "trajectory.txt",
    ]
    folder.close()
    assert list((tmp_path / ".work").iterdir()) == [tmp_path / ".work" / ".lock"]
    (place / "summary.json").write_text('{"valid": tr')
    assert folder.state(key) == "missing"


def test_a_new_attempt_replaces_an_invalid_one_which_is_kept(tmp_path: Path) -> None:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    spec = run_spec()
    for number in (1, 2):
        finished(folder, spec, valid=False)
        assert folder.state(spec.run_key) == "invalid"
        assert folder.store.attempts_of(spec.run_key) == number
    finished(folder, spec, valid=True)
    assert folder.state(spec.run_key) == "valid"
    assert folder.store.attempts_of(spec.run_key) == 3
    kept = tmp_path / "attempts" / spec.run_key
    assert sorted(path.name for path in kept.iterdir()) == ["1", "2"]
    inode = (folder.store.runs / spec.run_key).stat().st_ino
    finished(folder, spec, valid=False)  # a concurrent campaign was slower
    assert (folder.store.runs / spec.run_key).stat().st_ino == inode
    assert folder.run_keys() == [spec.run_key]


def test_a_view_is_left_and_entered_without_moving_a_run(tmp_path: Path) -> None:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    wanted, other_sources = specs(cells=1, runs=2), run_spec(cell="c0", software="older")
    for spec in (*wanted, other_sources):
        finished(folder, spec)
    inodes = {key: (folder.store.runs / key).stat().st_ino for key in folder.run_keys()}
    folder.show([other_sources.run_key])
    assert folder.run_keys() == [other_sources.run_key]
    folder.show(spec.run_key for spec in wanted)
    assert folder.run_keys() == sorted(spec.run_key for spec in wanted)
    assert {key: (folder.store.runs / key).stat().st_ino for key in inodes} == inodes


def test_further_repetitions_of_the_same_cell_are_found_by_their_keys(tmp_path: Path) -> None:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    made = specs(cells=2, runs=4)
    for spec in made[:4]:  # all of c0
        finished(folder, spec)
    finished(folder, run_spec(cell="c1", params={"x": 1}, repetition=3, seed=3))
    planned = [spec for spec in made if spec.repetition < 2]
    assert valid_repetitions(folder.store, planned) == made[2:4]


def test_runs_of_the_older_layout_get_their_place_in_the_store(tmp_path: Path) -> None:
    for place, key in (("runs", "a" * 16), ("stale", "b" * 16)):
        run = tmp_path / "tiny" / place / key
        run.mkdir(parents=True)
        for name in ("manifest.json", "summary.json"):
            (run / name).write_text('{"valid": true}')
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    assert folder.store.keys() == ["a" * 16, "b" * 16]
    assert folder.run_keys() == ["a" * 16]


def test_a_campaign_leaves_the_work_of_a_living_one_and_removes_that_of_a_dead_one(
    tmp_path: Path,
) -> None:
    alive, later = ResultFolder(tmp_path / "one"), ResultFolder(tmp_path / "two")
    alive.create()
    raw = alive.new_raw("0" * 16)
    dead = tmp_path / ".work" / "4711-dead"
    dead.mkdir()
    (dead / ".lock").touch()
    later.create()
    assert raw.is_dir() and not dead.exists()
    for folder in (alive, later):
        folder.close()


def test_a_lock_that_only_its_owner_may_write_is_seen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alive, later = ResultFolder(tmp_path / "one"), ResultFolder(tmp_path / "two")
    alive.create()
    raw = alive.new_raw("0" * 16)
    opened = os.open

    def foreign(path: Path, flags: int, *rest: int, dir_fd: int | None = None) -> int:
        """What another user's file answers; as root, no mode of a file would."""
        if path == raw.parent / ".lock" and flags & os.O_RDWR:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return opened(path, flags, *rest, dir_fd=dir_fd)

    with monkeypatch.context() as patch:
        patch.setattr(os, "open", foreign)
        later.create()
    assert raw.is_dir()
    for folder in (alive, later):
        folder.close()


def test_what_cannot_be_removed_is_moved_out_of_the_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    for _ in range(2):
        raw = folder.new_raw("0" * 16)
        (raw / "mobile").mkdir()
        monkeypatch.setattr(shutil, "rmtree", lambda *_, **__: None)  # of a container's user
    assert list(folder.new_raw("0" * 16).iterdir()) == []
    monkeypatch.undo()
    folder.close()
    assert list((tmp_path / ".work").iterdir()) == [tmp_path / ".work" / ".lock"]


def test_status_reports_missing_and_invalid_runs(tmp_path: Path) -> None:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    wanted = specs(cells=1, runs=3)
    finished(folder, wanted[0])
    finished(folder, wanted[1], valid=False)
    (folder.runs / "foreign").mkdir()
    runs = [{"run_key": s.run_key, **s.model_dump(mode="json")} for s in wanted]
    folder.write_json("experiment.json", {"runs": runs, "software": "test", "file": {}})
    found = status_of(tmp_path, "tiny", None, {"test"})
    cell = found.cells[0]
    assert (cell.valid, len(cell.invalid), cell.missing) == (1, 1, 1)
    assert "why" in cell.invalid[0]
    assert not found.complete
    assert any("foreign: not a run of this experiment" in line for line in found.notes)
    newer = status_of(tmp_path, "tiny", None, {"newer"})
    assert any("sources have changed" in line for line in newer.notes)


def test_what_no_plan_names_can_be_freed(tmp_path: Path) -> None:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    wanted, left = specs(cells=1, runs=2), run_spec(cell="c0", software="older")
    for spec in (*wanted, left):
        finished(folder, spec)
    runs = [{"run_key": s.run_key, **s.model_dump(mode="json")} for s in wanted]
    folder.write_json("experiment.json", {"runs": runs})
    folder.close()
    place = ("--results", str(tmp_path))
    code, out, _ = slambed("results", "size", *place)
    assert code == ExitCode.OK and "tiny: 2 runs" in out and "used by no experiment: 1 runs" in out
    code, out, _ = slambed("results", "prune", *place)
    assert code == ExitCode.OK and "would remove 1 runs" in out and len(folder.store.keys()) == 3
    code, out, _ = slambed("results", "prune", "--yes", *place)
    assert code == ExitCode.OK and folder.store.keys() == sorted(s.run_key for s in wanted)
    (folder.path / "experiment.json").write_text("{")
    assert "is not whole" in refused(ExitCode.BAD_INPUT, "results", "prune", "--yes", *place)


def kept_runs(results: Path, experiment: str, planned: RunSpec, *others: RunSpec) -> RunStore:
    """Makes an experiment's folder in which all these runs are finished and one is planned."""
    folder = ResultFolder(results / experiment)
    folder.create()
    for spec in (planned, *others):
        finished(folder, spec)
    listed = {"run_key": planned.run_key, **planned.model_dump(mode="json")}
    folder.write_json("experiment.json", {"runs": [listed]})
    folder.close()
    return folder.store


def test_a_run_that_cannot_be_removed_is_a_line_and_no_half_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = RunStore(tmp_path)
    store.open()
    run = store.runs / "0123456789abcdef"
    run.mkdir()
    (run / "summary.json").write_text("{}")
    store.close()

    def refuse(path: Path) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    with monkeypatch.context() as patched:
        patched.setattr("slambed.campaign.store.shutil.rmtree", refuse)
        with pytest.raises(SlambedError, match="cannot remove run 0123456789abcdef: Permission"):
            store.remove(run.name)
    assert not run.exists()
    store.open()  # sweeps what was left
    assert [path.name for path in (tmp_path / ".work").glob("removed.*")] == []
    store.close()


def pruned(results: Path, *options: str) -> list[str]:
    """Returns what `results prune` prints, without sizes."""
    code, out, err = slambed("results", "prune", *options, "--results", str(results))
    assert code == ExitCode.OK, err
    return [re.sub(r"[0-9.]+ MB", "MB", line) for line in out.splitlines()]


def test_runs_made_with_other_settings_stay_unless_they_are_meant(tmp_path: Path) -> None:
    planned = run_spec()
    with_set, older = run_spec(params={"x": 7}), run_spec(software="older")
    gone = run_spec(experiment="gone", seed=9)
    store = kept_runs(tmp_path, "tiny", planned, with_set, older, gone)
    assert pruned(tmp_path) == [
        "gone, which has no plan here: 1 runs, MB",
        "tiny, made with other settings than those of its last plan: 1 runs, MB; "
        "they stay without --other-settings",
        "tiny, of other sources: 1 runs, MB",
        "would remove 2 runs, MB; give --yes to do it",
    ]
    pruned(tmp_path, "--yes")
    assert store.keys() == sorted([planned.run_key, with_set.run_key])
    pruned(tmp_path, "--other-settings", "--yes")
    assert store.keys() == [planned.run_key]


def test_runs_of_a_system_that_the_experiment_no_longer_names_are_told_as_that(
    tmp_path: Path,
) -> None:
    """The plan has the same system in another variant, and the file names neither."""
    planned = run_spec(experiment="quickstart")
    gone = run_spec(experiment="quickstart", variant="former")
    with_set = run_spec(experiment="quickstart", params={"x": 7})
    choice = Library().experiment("quickstart")[0].systems[0]
    in_file = run_spec(
        experiment="quickstart", system=choice.system, variant=choice.variant or "any"
    )
    store = kept_runs(tmp_path, "quickstart", planned, gone, with_set, in_file)
    settings, system, _ = pruned(tmp_path)
    assert settings.startswith(
        "quickstart, made with other settings than those of its last plan: 2"
    )
    name = f"{gone.system}:former"
    assert system == f"quickstart, of {name}, which the experiment no longer names: 1 runs, MB"
    pruned(tmp_path, "--yes")
    assert store.keys() == sorted(s.run_key for s in (planned, with_set, in_file))


def test_runs_of_a_system_in_no_plan_stay_where_the_experiments_file_is_unknown(
    tmp_path: Path,
) -> None:
    """The file may still name the system: `--set systems=...` takes it out of the plan alone."""
    planned, other = run_spec(experiment="mine"), run_spec(experiment="mine", variant="former")
    store = kept_runs(tmp_path, "mine", planned, other)
    settings, _ = pruned(tmp_path, "--yes")
    assert "made with other settings than those of its last plan: 1" in settings
    assert store.keys() == sorted([planned.run_key, other.run_key])


def test_status_of_nothing_says_how_to_begin(tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match="slambed run tiny"):
        status_of(tmp_path, "tiny", None, set())
