# SPDX-License-Identifier: Apache-2.0
"""Systems that read a recorded folder: their input, and the processing of their trajectory."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from command_line import slambed
from data_samples import trajectory, write_prepared
from harness_parts import needs_root, run_spec
from test_data_export import write_stereo
from test_foreign import MINE, write_system

from slambed.campaign.foreign_trajectory import (
    check_rotations,
    frames_of,
    read_poses,
    record_poses,
)
from slambed.campaign.recordings import Recording
from slambed.data.trajectory import Trajectory, read_tum, write_tum
from slambed.engines.base import NodePlan
from slambed.engines.foreign import container_options, environment, player_arguments
from slambed.engines.result import RunResult, time_limit_s
from slambed.errors import SlambedError
from slambed.metrics.run_data import RunData
from slambed.metrics.run_summary import summary_of
from slambed.records.kept_spec import KeptSpec
from slambed.records.manifest import Manifest
from slambed.spec.device import Limits
from slambed.spec.experiment import Playback
from slambed.spec.library import Library
from slambed.spec.runtime import Runtime, foreign_digest

COMMAND = ["vo", "{frames}", "{trajectory}", "{folder}"]
READS = {"reads": "tum", "trajectory": "poses.txt", "mobile": {"command": COMMAND}}


def runtime(**changes: Any) -> Runtime:
    return Runtime.model_validate(READS | changes)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"reads": "bag"}, "'tum', 'euroc' or 'kitti'"),
        ({"trajectory": ""}, "leaves its poses in a file: trajectory"),
        ({"trajectory": "trajectory.txt"}, "is the player's"),
        ({"trajectory": "../poses.txt"}, "expected the name of a file, without a folder"),
        ({"trajectory_format": "euroc"}, "'tum' or 'kitti'"),
        ({"reads": None}, "trajectory belongs to a system that reads a folder"),
        ({"mobile": {"command": ["vo"], "client": True}}, "has no client"),
    ],
)
def test_what_makes_no_sense_is_refused(change: dict[str, object], line: str) -> None:
    with pytest.raises(ValueError, match=line):
        runtime(**change)


@pytest.mark.parametrize("written", [READS, {"mobile": {"command": ["vo"], "client": True}}])
def test_what_is_written_down_whole_is_read_back(written: dict[str, object]) -> None:
    """In the form of experiment.json, which `slambed status` reads."""
    found = Runtime.model_validate(written)
    assert Runtime.model_validate_json(found.model_dump_json()) == found


def test_a_layout_must_hold_what_the_system_plays(tmp_path: Path) -> None:
    content = yaml.safe_load(MINE) | {"sensors": ["rgbd", "mono"], "runtime": READS}
    path = write_system(tmp_path / "mine", yaml.safe_dump(content))
    with pytest.raises(SlambedError, match="layout tum holds no mono sequence"):
        Library().system(str(path))


def test_systems_that_read_no_folder_keep_their_software(tmp_path: Path) -> None:
    """The digest from before this option existed: old runs stay valid."""
    plain = Runtime.model_validate({"mobile": {"command": ["no_such_program"]}})
    (tmp_path / "run.py").write_text("print(1)\n")
    assert foreign_digest(plain, tmp_path, {}) == "d53ebf83cf4b"
    read = foreign_digest(runtime(), tmp_path, {})
    assert read != foreign_digest(runtime(trajectory_format="kitti"), tmp_path, {})


def test_the_command_is_given_where_the_folder_is_and_where_poses_go(tmp_path: Path) -> None:
    frames = tmp_path / "frames"
    plan = NodePlan(
        "mobile", "key", tmp_path, tmp_path, Limits(), [0], False, runtime(), tmp_path, frames
    )
    arguments = player_arguments(plan, "/out/run.json", "/system", "/frames")
    assert arguments[6:] == [
        *("--no-client", "--trajectory", "poses.txt"),
        *("--", "vo", "/frames", "/out/mobile/poses.txt", "/system"),
    ]
    variables = environment(plan, "/clients", "/bin", "/out/run.json", "/frames")
    assert variables["SLAMBED_FRAMES"] == "/frames"
    assert variables["SLAMBED_TRAJECTORY"] == "/out/mobile/poses.txt"
    options = container_options(plan, "image", "/out/run.json", "/out/go")
    assert "/frames" in options["command"]
    assert options["environment"]["SLAMBED_FRAMES"] == "/frames"


def test_a_folder_is_written_once_a_window_and_reports_no_truth(tmp_path: Path) -> None:
    sequence = write_prepared(tmp_path / "prepared")
    assert sequence.groundtruth() is not None
    whole = Recording.of(sequence, Playback(), "tum", tmp_path / "cache")
    folder = whole.folder()
    assert len(list((folder / "rgb").iterdir())) == 4
    assert not list(folder.rglob("groundtruth*"))
    before = (folder / "rgb.txt").stat().st_mtime_ns
    realtime = Recording.of(sequence, Playback(mode="every_frame"), "tum", tmp_path / "cache")
    assert realtime.folder() == folder and (folder / "rgb.txt").stat().st_mtime_ns == before
    part = Recording.of(sequence, Playback(start_s=0.1), "tum", tmp_path / "cache")
    assert part.folder() != folder
    assert len(list((part.folder() / "rgb").iterdir())) == len(part.indices) < 4
    assert not list((tmp_path / "cache" / "recorded").glob(".*partial*"))


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    """Four frames of sequence 2, 0.1 s apart, in KITTI's time."""
    return Recording.of(write_stereo(tmp_path / "stereo"), Playback(), "kitti", tmp_path)


def tum_file(path: Path, stamps_s: list[float], **changes: Any) -> Path:
    write_tum(path, trajectory(stamps_s))
    return path


def test_poses_belong_to_the_frames_whose_time_they_have(
    tmp_path: Path, recording: Recording
) -> None:
    path = tum_file(tmp_path / "poses.txt", [0.1, 0.3004])
    poses = read_poses(path, runtime(), recording)
    assert list(frames_of(path, poses, recording)) == [1, 3]


@pytest.mark.parametrize(
    ("stamps_s", "line"),
    [
        ([1000.0, 1000.1], "2 of 2 poses have the time of no frame"),
        ([0.0, 0.15], "1 of 2 poses have the time of no frame, the first one 0.150000 s"),
        ([0.1e9, 0.2e9], r"write the time stamps of the folder, in seconds \(0.000000 to 0.300"),
        ([0.1, 0.1002], "two poses of the frame at 0.100000 s"),
    ],
)
def test_wrong_time_stamps_are_refused(
    tmp_path: Path, recording: Recording, stamps_s: list[float], line: str
) -> None:
    path = tum_file(tmp_path / "poses.txt", stamps_s)
    with pytest.raises(SlambedError, match=line):
        frames_of(path, read_poses(path, runtime(), recording), recording)


def kitti_file(path: Path, count: int, scale: float = 1.0) -> Path:
    poses = np.tile(np.eye(4)[:3], (count, 1, 1))
    poses[:, :, :3] *= scale
    poses[:, 0, 3] = np.arange(count)
    np.savetxt(path, poses.reshape(count, 12))
    return path


def test_a_line_of_kitti_is_a_frame(tmp_path: Path, recording: Recording) -> None:
    kitti = runtime(reads="kitti", trajectory_format="kitti")
    path = kitti_file(tmp_path / "poses.txt", 4)
    poses = read_poses(path, kitti, recording)
    assert np.allclose(poses.stamps_s, [0, 0.1, 0.2, 0.3])
    assert np.allclose(poses.positions_m[:, 0], [0, 1, 2, 3])
    with pytest.raises(SlambedError, match="3 x 12 numbers; KITTI's poses have no times"):
        read_poses(kitti_file(path, 3), kitti, recording)
    with pytest.raises(SlambedError, match="the pose of line 1 is no rotation"):
        read_poses(kitti_file(path, 4, scale=1.01), kitti, recording)
    with pytest.raises(SlambedError, match="the pose of line 1 is no rotation"):
        read_poses(kitti_file(path, 4, scale=-1.0), kitti, recording)
    path.write_text("1 2 three\n")
    with pytest.raises(SlambedError, match=r"poses\.txt: cannot be read as KITTI's poses"):
        read_poses(path, kitti, recording)


def test_a_quaternion_that_is_none_is_refused(tmp_path: Path, recording: Recording) -> None:
    path = tmp_path / "poses.txt"
    path.write_text("0.0 0 0 0 0 0 0 1\n0.1 0 0 0 0 0 0 1.1\n")
    with pytest.raises(SlambedError, match=r"at 0\.100000 s is no rotation.*length 1\.1000"):
        check_rotations(path, read_poses(path, runtime(), recording))
    path.write_text("0.0 0 0 0 0 0 1\n")
    with pytest.raises(SlambedError, match=r"^poses\.txt:1: not a pose"):
        read_poses(path, runtime(), recording)
    path.write_text("# nothing\n")
    with pytest.raises(SlambedError, match="no pose in it"):
        read_poses(path, runtime(), recording)


def left(tmp_path: Path, stamps_s: list[float]) -> Path:
    """Creates a run's raw folder like the player."""
    mobile = tmp_path / "raw" / "mobile"
    mobile.mkdir(parents=True)
    (mobile / "events.jsonl").write_text('{"t_ns":5,"type":"warning","text":"before"}\n')
    tum_file(mobile / "poses.txt", stamps_s)
    (mobile / "trajectory.txt").write_bytes((mobile / "poses.txt").read_bytes())
    return tmp_path / "raw"


def test_frames_losses_and_poses_come_from_the_time_stamps(
    tmp_path: Path, recording: Recording
) -> None:
    raw = left(tmp_path, [0.1, 0.3])
    result = record_poses(
        RunResult("completed", None, mobile_until_s=7.5), runtime(), recording, raw
    )
    assert result.outcome == "completed"
    events = [json.loads(x) for x in (raw / "mobile" / "events.jsonl").read_text().splitlines()]
    assert events[0]["text"] == "before" and {e["t_ns"] for e in events[1:]} == {7_500_000_000}
    states = [e["state"] for e in events if e["type"] == "frame_tracked"]
    assert states == ["not_initialized", "ok", "lost", "ok"]
    others = [e["type"] for e in events[1:] if e["type"] != "frame_tracked"]
    assert others == ["initialized", "track_lost", "relocalized"]
    kept = read_tum(raw / "mobile" / "trajectory.txt")
    assert np.allclose(kept.stamps_s, [1000.1, 1000.3])  # recorded time, as for every system

    spec = KeptSpec.of({"runtime": READS, "system": "mine"})
    run = RunData(raw, spec, tmp_path / "stereo" / "groundtruth.txt", Manifest(frames_offered=4))
    summary = summary_of(run)
    assert summary["frames_total"] == 4 and summary["frames_tracked"] == 2
    assert summary["coverage"] == 0.5 and summary["track_losses"] == 1
    assert summary["loss_times_s"] == "0.2" and summary["wall_s"] == 7.5
    for unknown in ("frames_dropped", "coverage_processed", "track_ms_median", "ate_live_rmse_m"):
        assert summary[unknown] is None
    assert not any("trajectory_live" in line for line in run.problems)


def test_a_trajectory_that_is_none_is_how_the_system_died(
    tmp_path: Path, recording: Recording
) -> None:
    raw = left(tmp_path, [55.0])
    result = record_poses(RunResult("completed", None), runtime(), recording, raw)
    assert result.outcome == "died" and "the time of no frame" in (result.reason or "")
    assert not (raw / "mobile" / "trajectory.txt").exists()
    ended = RunResult("timed_out", "late")
    assert record_poses(ended, runtime(), recording, raw) is ended


def test_a_reader_has_the_time_of_who_waits_for_tracking() -> None:
    realtime = run_spec(playback=Playback())
    assert time_limit_s(realtime, 10) < 50
    assert time_limit_s(realtime.model_copy(update={"runtime": runtime()}), 10) > 100


@needs_root
def test_an_experiment_says_what_is_not_measured(tmp_path: Path) -> None:
    content = yaml.safe_load(MINE) | {"runtime": READS}
    write_system(tmp_path / "mine", yaml.safe_dump(content))
    experiment = tmp_path / "one.yaml"
    text = (
        "id: one\ntitle: one\nsystems: [{system: ./mine/system.yaml}]\ndatasets: [synthetic_room]\n"
        "devices: {mobile: raspberry_pi_4}\n"
    )
    experiment.write_text(text)
    code, out, err = slambed("run", str(experiment), "--check", "--engine", "local")
    assert code == 0, err
    assert "mine reads a recorded folder at its own speed" in out and "left empty" in out
    experiment.write_text(text + "playback: {stop_at_first_loss: true}\n")
    code, _, err = slambed("run", str(experiment), "--check", "--engine", "local")
    assert code == 2 and err.count("\n") == 1 and "leave stop_at_first_loss out" in err


def test_poses_are_sorted_by_time(tmp_path: Path, recording: Recording) -> None:
    rows = trajectory([0.3, 0.0, 0.1])
    path = tmp_path / "poses.txt"
    write_tum(path, Trajectory(rows.stamps_s, rows.positions_m, rows.quaternions_xyzw))
    assert list(frames_of(path, read_poses(path, runtime(), recording), recording)) == [0, 1, 3]
