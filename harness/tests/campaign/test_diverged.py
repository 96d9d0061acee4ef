# SPDX-License-Identifier: Apache-2.0
"""Systems that diverge or leave something else than a path: an outcome with its reason, and no
error."""

import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data_samples import trajectory
from harness_parts import run_spec
from test_data_export import write_stereo

from slambed.campaign.left_files import judge_paths
from slambed.campaign.raw_folder import add_summary, prepare_raw
from slambed.data.trajectory import write_tum
from slambed.engines.result import RunResult
from slambed.metrics.summary import Summary
from slambed.records.manifest import EngineFacts
from slambed.spec.experiment import Playback
from slambed.spec.runtime import Runtime

Leaves = Callable[[Path], object]
STAMPS_S = (0.0, 0.1, 0.2, 0.3)


def lines(*rows: str) -> Leaves:
    return lambda path: path.write_text("\n".join(rows) + "\n")


def tum(x: str = "0", stamps: tuple[str, ...] = ("0.0", "0.1", "0.2", "0.3")) -> tuple[str, ...]:
    """A good path, but for the position of its last pose."""
    return tuple(f"{t} {x if t == stamps[-1] else n} 0 1 0 0 0 1" for n, t in enumerate(stamps))


def kitti(last: str = "3", first: str = "1") -> tuple[str, ...]:
    return tuple(
        f"{first if x == last else 1} 0 0 {x} 0 1 0 0 0 0 1 0" for x in ("0", "1", "2", last)
    )


def link(target: str) -> Leaves:
    return lambda path: path.symlink_to(target)


def torn(*rows: str) -> Leaves:
    return lambda path: path.write_text("\n".join(rows)[:-9])


NANOSECONDS = tuple(f"{round(t * 1e9)}" for t in STAMPS_S)
TUM: dict[str, tuple[Leaves, str]] = {
    "1e300": (lines(*tum("1e300")), r"diverged: the pose at 1000\.300000 s is 1e\+300 m away"),
    "minus 1e150": (lines(*tum("-1e150")), r"diverged: .* is 1e\+150 m away"),
    "nan": (lines(*tum("nan")), r"poses\.txt:4: not a pose"),
    "inf": (lines(*tum("-inf")), r"poses\.txt:4: not a pose"),
    "empty": (lines(), "poses.txt: no pose in it"),
    "nothing": (lambda path: None, "poses.txt: cannot be read: No such file"),
    "torn": (torn(*tum()), r"poses\.txt:4: not a pose"),
    "folder": (Path.mkdir, "poses.txt: it is a folder; write a file"),
    "dangling link": (link("nowhere"), "poses.txt: it is a link; write a file"),
    "endless link": (link("/dev/zero"), "poses.txt: it is a link; write a file"),
    "link to itself": (link("poses.txt"), "poses.txt: it is a link; write a file"),
    "pipe": (os.mkfifo, "poses.txt: it is a pipe; write a file"),
    "nanoseconds": (lines(*tum(stamps=NANOSECONDS)), "3 of 4 poses have the time of no frame"),
    "header only": (lines("time tx ty tz qx qy qz qw"), r"poses\.txt:1: not a pose"),
    "bytes": (lambda path: path.write_bytes(b"0 0\0 0"), "poses.txt:1: a zero byte"),
}
KITTI: dict[str, tuple[Leaves, str]] = {
    "1e300": (lines(*kitti("1e300")), r"diverged: the pose at 1000\.300000 s is 1e\+300 m away"),
    "1e300 in the rotation": (lines(*kitti(first="1e300")), "the pose of line 4 is no rotation"),
    "nan": (lines(*kitti("nan")), "the pose of line 4 has nan or inf; write numbers"),
    "inf": (lines(*kitti("inf")), "the pose of line 4 has nan or inf; write numbers"),
    "empty": (lines(), "poses.txt: no pose in it; write a line for each frame"),
    "torn": (torn(*kitti()), r"cannot be read as KITTI's poses \("),
    "header": (lines("r11 r12", *kitti()), r"cannot be read as KITTI's poses \("),
    "folder": (Path.mkdir, "poses.txt: it is a folder; write a file"),
    "pipe": (os.mkfifo, "poses.txt: it is a pipe; write a file"),
}


class Left:
    """A run that completed as far as its programs said, and what it left."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("SLAMBED_CACHE", str(folder / "cache"))
        self.sequence = folder / "stereo"
        write_stereo(self.sequence)
        self.raw = folder / "raw"
        self.mobile = self.raw / "mobile"
        self.mobile.mkdir(parents=True)
        events = [
            {"t_ns": n * 10**8, "type": "frame_tracked", "frame": n, "seq_s": n / 10, "state": "ok"}
            for n in range(4)
        ]
        (self.mobile / "events.jsonl").write_text("".join(json.dumps(e) + "\n" for e in events))
        for name in ("trajectory.txt", "trajectory_live.txt"):
            write_tum(self.mobile / name, trajectory([1000 + t for t in STAMPS_S]))

    def summary(self, **changes: Any) -> Summary:
        spec = run_spec(playback=Playback(), device_edge=None, **changes)
        start = prepare_raw(spec, self.raw)
        engine, done = EngineFacts(image_id=None), RunResult("completed", None, mobile_until_s=1.0)
        found = add_summary(spec, self.raw, self.sequence, engine, ["slambed"], start, done)
        # What is written is what a campaign reads later, and it is JSON.
        assert Summary.read(self.raw / "summary.json") == found
        return found


@pytest.fixture
def left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Left:
    return Left(tmp_path, monkeypatch)


def check(found: Summary, reason: str) -> None:
    assert found.outcome == "died" and found.valid
    assert re.search(reason, str(found["outcome_reason"])), found["outcome_reason"]
    assert len(str(found["outcome_reason"]).splitlines()) == 1
    assert found["coverage"] == 0 and found["ate_rmse_m"] is None
    assert all(not isinstance(v, float) or np.isfinite(v) for v in found.values())


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("kind", "case"),
    [("tum", case) for case in TUM] + [("kitti", case) for case in KITTI],
)
def test_a_system_that_reads_a_folder(left: Left, kind: str, case: str) -> None:
    leaves, reason = (TUM if kind == "tum" else KITTI)[case]
    leaves(left.mobile / "poses.txt")
    runtime = {"reads": "kitti", "trajectory": "poses.txt", "trajectory_format": kind}
    runtime |= {"mobile": {"command": ["vo"]}}
    check(left.summary(runtime=Runtime.model_validate(runtime)), reason)


def test_a_header_line_is_no_fault(left: Left) -> None:
    (left.mobile / "events.jsonl").unlink()
    lines("time tx ty tz qx qy qz qw", *tum("3"))(left.mobile / "poses.txt")
    runtime = {"reads": "kitti", "trajectory": "poses.txt", "mobile": {"command": ["vo"]}}
    found = left.summary(runtime=Runtime.model_validate(runtime))
    assert found.outcome == "completed" and found["frames_tracked"] == 4


FINAL = "trajectory.txt"
OURS: dict[str, tuple[str, Leaves, str]] = {
    "1e300": (FINAL, lines("1000.1 1e300 0 0 0 0 0 1"), r"trajectory\.txt: diverged: .* 1e\+300 m"),
    "live 1e300": (
        *("trajectory_live.txt", lines("1000.1 1e300 0 0 0 0 0 1")),
        r"mobile node: trajectory_live\.txt: diverged: .* 1e\+300 m away",
    ),
    "nan": (FINAL, lines("1000.1 nan 0 0 0 0 0 1"), r"trajectory\.txt:1: not a pose"),
    "torn": (FINAL, lines("1000.1 0 0 0 0 0 0 1", "1000.2 0 0"), r"trajectory\.txt:2: not a pose"),
    "folder": (FINAL, Path.mkdir, "trajectory.txt: it is a folder"),
    "link": (FINAL, link("/dev/zero"), "trajectory.txt: it is a link"),
    "pipe": (FINAL, os.mkfifo, "trajectory.txt: it is a pipe"),
    "events are a pipe": ("events.jsonl", os.mkfifo, "events.jsonl: it is a pipe"),
    "report is a link": ("node.json", link("/dev/zero"), "node.json: it is a link"),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", OURS)
def test_any_other_system(left: Left, case: str) -> None:
    """Virtual or live, of ours or by a client of the player: the files are the same."""
    name, leaves, reason = OURS[case]
    (left.mobile / name).unlink(missing_ok=True)
    leaves(left.mobile / name)
    check(left.summary(), reason)
    assert not (left.mobile / name).is_symlink()


def test_a_path_that_is_empty_is_one_of_a_system_that_never_tracked(left: Left) -> None:
    for name in ("trajectory.txt", "trajectory_live.txt"):
        (left.mobile / name).write_text("# nothing\n")
    found = left.summary()
    assert found.outcome == "completed" and found["ate_rmse_m"] is None


def test_a_run_that_ended_otherwise_keeps_its_reason(left: Left) -> None:
    lines("1000.1 1e300 0 0 0 0 0 1")(left.mobile / "trajectory.txt")
    found = judge_paths(RunResult("timed_out", "late"), left.raw)
    assert (found.outcome, found.reason) == ("timed_out", "late")
    assert not (left.mobile / "trajectory.txt").exists()
