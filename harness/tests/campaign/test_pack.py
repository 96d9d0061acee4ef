# SPDX-License-Identifier: Apache-2.0
"""Packed runs: content of the file, and the results folder after unpacking."""

import json
import os
import tarfile
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command_line import refused, slambed
from harness_parts import specs

from slambed.campaign.folder import ResultFolder
from slambed.campaign.status import status_of
from slambed.campaign.store import STORE
from slambed.errors import ExitCode
from slambed.metrics.collect import events_file, is_stored, stored_log
from slambed.spec.run_spec import RunSpec


def experiment(results: Path, name: str, runs: list[RunSpec], invalid: int = 0) -> ResultFolder:
    """An executed experiment; its last `invalid` runs are invalid."""
    folder = ResultFolder(results / name)
    folder.create()
    for number, spec in enumerate(runs):
        raw = folder.new_raw(spec.run_key)
        (raw / "manifest.json").write_text(json.dumps({"spec": spec.model_dump(mode="json")}))
        valid = number < len(runs) - invalid
        (raw / "summary.json").write_text(json.dumps({"valid": valid, "ate_rmse_m": number}))
        (raw / "events.parquet").write_bytes(b"events")
        folder.commit(spec.run_key, raw)
    listed = [{"run_key": s.run_key, **s.model_dump(mode="json")} for s in runs]
    folder.write_json("experiment.json", {"runs": listed, "software": "test", "file": {}})
    truth = folder.path / "groundtruth" / "hall.txt"
    truth.parent.mkdir()
    truth.write_text("0 0 0 0 0 0 0 1\n")
    folder.close()
    return folder


@pytest.fixture
def packed(tmp_path: Path) -> Path:
    """Packs four runs of `tiny`, the last one invalid, and a second experiment."""
    runs = specs(cells=2, runs=3)
    experiment(tmp_path / "here", "tiny", runs[:4], invalid=1)
    experiment(tmp_path / "here", "other", runs[4:])
    file = tmp_path / "tiny.tar.xz"
    code, out, err = slambed("results", "pack", "tiny", "-o", str(file), *of(tmp_path / "here"))
    assert code == ExitCode.OK, err
    assert "tiny.tar.xz: 3 runs" in out
    return file


def of(results: Path) -> tuple[str, str]:
    return "--results", str(results)


def unpack(file: Path, results: Path) -> str:
    code, out, err = slambed("results", "unpack", str(file), *of(results))
    assert code == ExitCode.OK, err
    return out


def test_another_machine_goes_on_from_what_was_packed(packed: Path, tmp_path: Path) -> None:
    there = tmp_path / "there"
    assert f"3 runs, 3 of them new in {there}" in unpack(packed, there)
    runs = specs(cells=2, runs=3)[:4]
    folder = ResultFolder(there / "tiny")
    assert [folder.state(run.run_key) for run in runs] == ["valid"] * 3 + ["missing"]
    assert folder.run_keys() == sorted(run.run_key for run in runs[:3])
    found = status_of(there, "tiny", None, {"test"})
    assert sum(cell.valid for cell in found.cells) == 3
    assert sum(cell.missing for cell in found.cells) == 1
    assert (there / "tiny" / "groundtruth" / "hall.txt").is_file()
    assert not (there / "other").exists()
    assert not (folder.store.runs / runs[0].run_key / "events.parquet").exists()


def test_the_same_runs_give_the_same_bytes(packed: Path, tmp_path: Path) -> None:
    unpack(packed, tmp_path / "there")
    again = tmp_path / "again.tar.xz"
    assert slambed("results", "pack", "tiny", "-o", str(again), *of(tmp_path / "there"))[0] == 0
    assert again.read_bytes() == packed.read_bytes()


def test_whole_runs_have_their_events(packed: Path, tmp_path: Path) -> None:
    file = tmp_path / "whole.tar.xz"
    code, _, err = slambed(
        "results", "pack", "tiny", "other", "--whole", "-o", str(file), *of(tmp_path / "here")
    )
    assert code == ExitCode.OK, err
    assert "5 runs, 5 of them new" in unpack(file, tmp_path / "there")
    for run in (tmp_path / "there" / "runs").iterdir():
        assert (run / "events.parquet").read_bytes() == b"events"


def test_some_events_are_kept_and_packed_again(tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    experiment(here, "tiny", specs(cells=1, runs=2))
    rows = [
        {"t_ns": 1, "type": "frame_tracked", "frame": 1, "keyframe": None},
        {"t_ns": 2, "type": "keyframe_sent", "keyframe": 7},
    ]
    for run in (here / "runs").iterdir():
        pq.write_table(pa.Table.from_pylist(rows), run / "events.parquet")
    asked = ("--events", "keyframe_sent", "--events", "loop_closed")
    for results in (here, there):
        file = tmp_path / f"{results.name}.tar.xz"
        code, out, err = slambed("results", "pack", *asked, "-o", str(file), *of(results))
        assert code == ExitCode.OK, err
        assert "2 runs" in out and ", 2 events keyframe_sent, 0 events loop_closed" in out
        unpack(file, there)
    assert (tmp_path / "here.tar.xz").read_bytes() == (tmp_path / "there.tar.xz").read_bytes()
    (run, _) = sorted((there / "runs").iterdir())
    source = events_file(run, ["keyframe_sent", "loop_closed"])
    assert source is not None
    assert [e["keyframe"] for e in stored_log(source, ["keyframe_sent"]).events] == [7]
    assert stored_log(source, ["loop_closed"]).events == []
    assert events_file(run, ["frame_tracked"]) is None and not is_stored(run)


def test_events_that_cannot_be_read_are_named(packed: Path, tmp_path: Path) -> None:
    asked = ("pack", "tiny", "--events", "loop_closed", "-o", str(tmp_path / "new.tar.xz"))
    line = refused(ExitCode.BAD_INPUT, "results", *asked, *of(tmp_path / "here"))
    assert "events.parquet: unreadable" in line and not (tmp_path / "new.tar.xz").exists()


def test_events_of_whole_runs_cannot_be_chosen(packed: Path, tmp_path: Path) -> None:
    file = tmp_path / "whole.tar.xz"
    asked = ("--whole", "--events", "loop_closed", "-o", str(file), *of(tmp_path / "here"))
    line = refused(ExitCode.BAD_INPUT, "results", "pack", *asked)
    assert "--whole keeps all events; leave out --events" in line and not file.exists()


def test_what_is_there_and_valid_stays(packed: Path, tmp_path: Path) -> None:
    here = tmp_path / "here"
    plan = (here / "tiny" / "experiment.json").read_bytes()
    runs = {path.name: path.stat().st_ino for path in (here / "runs").iterdir()}
    (here / "tiny" / "groundtruth" / "hall.txt").write_text("mine\n")
    assert "3 runs, 0 of them new" in unpack(packed, here)
    assert {path.name: path.stat().st_ino for path in (here / "runs").iterdir()} == runs
    assert (here / "tiny" / "experiment.json").read_bytes() == plan
    assert (here / "tiny" / "groundtruth" / "hall.txt").read_text() == "mine\n"


def test_the_runs_that_a_torn_file_has_are_counted(tmp_path: Path) -> None:
    runs = specs(cells=1, runs=2)
    here, there = tmp_path / "here", tmp_path / "there"
    experiment(here, "tiny", runs)
    last = here / STORE / max(run.run_key for run in runs)  # the file is in the order of keys
    (last / "events.parquet").write_bytes(os.urandom(200_000))
    file = tmp_path / "tiny.tar.xz"
    code, _, err = slambed("results", "pack", "tiny", "-o", str(file), "--whole", *of(here))
    assert code == ExitCode.OK, err
    file.write_bytes(file.read_bytes()[:-100_000])
    line = refused(ExitCode.BAD_INPUT, "results", "unpack", str(file), *of(there))
    kept = list((there / STORE).iterdir())
    assert f"{len(kept)} of its runs were whole" in line and len(kept) == 1


def test_a_torn_file_leaves_no_half_run(packed: Path, tmp_path: Path) -> None:
    torn = tmp_path / "torn.tar.xz"
    torn.write_bytes(packed.read_bytes()[:-200])
    there = tmp_path / "there"
    line = refused(ExitCode.BAD_INPUT, "results", "unpack", str(torn), *of(there))
    kept = list((there / "runs").iterdir())
    assert "torn.tar.xz is torn" in line
    assert not kept or f"{len(kept)} of its runs were whole and are kept in {there}" in line
    for run in (there / "runs").iterdir():
        assert json.loads((run / "summary.json").read_bytes())["valid"]
    assert [path.name for path in (there / ".work").iterdir()] == [".lock"]


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("../outside/manifest.json", tarfile.REGTYPE),
        ("/tmp/outside/manifest.json", tarfile.REGTYPE),
        ("runs/0123/manifest.json", tarfile.SYMTYPE),
        ("runs/manifest.json", tarfile.REGTYPE),
        ("loose.txt", tarfile.REGTYPE),
        ("somebodys/notes.txt", tarfile.REGTYPE),
    ],
)
def test_a_foreign_archive_is_refused_and_writes_nothing(
    name: str, kind: bytes, tmp_path: Path
) -> None:
    file = tmp_path / "foreign.tar.xz"
    with tarfile.open(file, "w:xz") as out:
        member = tarfile.TarInfo(name)
        member.type = kind
        member.linkname = "/etc/passwd"
        out.addfile(member)
    there = tmp_path / "there"
    line = refused(ExitCode.BAD_INPUT, "results", "unpack", str(file), *of(there))
    assert "no file of `slambed results pack`" in line and name.partition("/")[0] in line
    assert not (tmp_path / "outside").exists()
    assert [path.name for path in there.rglob("*") if path.is_file()] == [".lock"]


def test_what_cannot_be_packed_or_unpacked_is_reported(packed: Path, tmp_path: Path) -> None:
    here = tmp_path / "here"
    line = refused(2, "results", "pack", "tyni", "-o", str(packed), *of(here))
    assert "no results of tyni" in line and "other, tiny" in line
    no_folder = str(tmp_path / "nowhere" / "x.tar.xz")
    assert "cannot pack: No such file" in refused(
        ExitCode.ENVIRONMENT, "results", "pack", "tiny", "-o", no_folder, *of(here)
    )
    empty = tmp_path / "empty.tar.xz"
    tarfile.open(empty, "w:xz").close()
    assert "nothing is in it" in refused(2, "results", "unpack", str(empty), *of(here))
    cut = tmp_path / "cut.tar.xz"
    cut.write_bytes(packed.read_bytes()[:-5])
    assert "cut.tar.xz is torn" in refused(2, "results", "unpack", str(cut), *of(here))
    plan_alone = tmp_path / "plan.tar.xz"
    with tarfile.open(packed) as whole, tarfile.open(plan_alone, "w:xz") as out:
        member = whole.getmember("tiny/experiment.json")
        out.addfile(member, whole.extractfile(member))
    assert "has no run in it" in refused(2, "results", "unpack", str(plan_alone), *of(here))
    text = tmp_path / "text.tar.xz"
    text.write_text("not one")
    assert "is torn, or no file" in refused(2, "results", "unpack", str(text), *of(here))
    assert "No such file" in refused(2, "results", "unpack", no_folder, *of(here))
    assert "Is a directory" in refused(2, "results", "unpack", str(here), *of(here))
