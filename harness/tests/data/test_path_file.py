# SPDX-License-Identifier: Apache-2.0
"""`slambed evaluate` with KITTI's poses and with topics of bags."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import refused, slambed
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from slambed.data.path_file import read_path
from slambed.data.trajectory import Trajectory, write_tum

STORE = get_typestore(Stores.ROS1_NOETIC)
FRAMES = 200


def drive(scale: float = 1.0) -> Trajectory:
    """A curve of 200 m; another scale is another estimate of it."""
    angle = np.linspace(0.0, 2.0, FRAMES)
    forward = 100.0 * scale * np.column_stack([np.sin(angle), 0.1 * angle, 1.0 - np.cos(angle)])
    turns = Rotation.from_rotvec(np.outer(angle, [0.0, 1.0, 0.0])).as_quat()
    return Trajectory(0.1 * np.arange(FRAMES), forward, turns)


def write_kitti(path: Path, drawn: Trajectory) -> Path:
    matrices = drawn.rotations().as_matrix()
    rows = np.concatenate([matrices, drawn.positions_m[:, :, None]], axis=2).reshape(-1, 12)
    np.savetxt(path, rows, fmt="%.9e")
    return path


def write_bag(path: Path, topics: dict[str, Trajectory], *, points: bool = False) -> Path:
    kind = f"geometry_msgs/msg/{'Point' if points else 'Pose'}Stamped"
    types: Any = STORE.types
    with Writer(path) as writer:
        for topic, drawn in topics.items():
            connection = writer.add_connection(topic, kind, typestore=STORE)
            for row in drawn.rows():
                ns = round(1e9 * (row[0] + 100.0))
                stamp = types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
                header = types["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="map")
                place = types["geometry_msgs/msg/Point"](*row[1:4])
                turn = types["geometry_msgs/msg/Quaternion"](*row[4:8])
                pose = types["geometry_msgs/msg/Pose"](position=place, orientation=turn)
                value = place if points else pose
                message = types[kind](header, value)
                writer.write(connection, ns, STORE.serialize_ros1(message, kind))
    return path


def ate_of(*arguments: str | Path) -> float:
    code, out, err = slambed("evaluate", *map(str, arguments), "--json")
    assert code == 0, err
    found = json.loads(out)["ate_m"]["rmse"]
    assert isinstance(found, float)
    return found


def test_kittis_poses_go_by_line(tmp_path: Path) -> None:
    true = write_kitti(tmp_path / "true.txt", drive())
    own = write_kitti(tmp_path / "own.txt", drive(1.01))
    code, out, err = slambed("evaluate", str(own), str(true))
    assert code == 0 and err.count("they are taken as 0.1 s apart") == 2
    assert "KITTI's errors over 100 to 800 m: 0.95" in out and "200 pairs" in out
    plain = [tmp_path / "own.tum", tmp_path / "true.tum"]
    write_tum(plain[0], drive(1.01))
    write_tum(plain[1], drive())
    assert ate_of(own, true) == pytest.approx(ate_of(*plain), abs=1e-6)
    short = write_kitti(tmp_path / "short.txt", drive().take(np.arange(150)))
    assert "150 poses of KITTI in the estimate and 200" in refused(
        2, "evaluate", str(short), str(true)
    )


def test_with_scale_the_rpe_is_of_the_scaled_path_too(tmp_path: Path) -> None:
    true = write_kitti(tmp_path / "true.txt", drive())
    own = write_kitti(tmp_path / "own.txt", drive(0.5))
    code, out, err = slambed("evaluate", str(own), str(true), "--with-scale", "--json")
    assert code == 0, err
    found = json.loads(out)
    assert found["rpe"]["translation_m"]["rmse"] == pytest.approx(0.0, abs=1e-6)
    assert found["kitti"]["translation_percent"] == pytest.approx(0.0, abs=1e-4)


def test_kittis_poses_get_times_from_a_file(tmp_path: Path) -> None:
    own = write_kitti(tmp_path / "own.txt", drive(1.01))
    truth = tmp_path / "true.txt"
    write_tum(truth, drive())
    assert "give a file of times (--times)" in refused(2, "evaluate", str(own), str(truth))
    times = tmp_path / "times.txt"
    times.write_text("".join(f"{0.1 * n:e}\n" for n in range(FRAMES)))
    assert ate_of(own, truth, "--times", times) > 0.1
    times.write_text("0\n0.1\n")
    line = refused(2, "evaluate", str(own), str(truth), "--times", str(times))
    assert "2 times for the 200 poses" in line
    assert "neither" in refused(2, "evaluate", str(truth), str(truth), "--times", str(times))


def test_twelve_numbers_that_are_no_rotation_are_refused(tmp_path: Path) -> None:
    path = write_kitti(tmp_path / "a.txt", drive())
    lines = path.read_text().splitlines()
    lines[3] = " ".join(["2"] * 12)
    path.write_text("\n".join(lines))
    assert f"{path}:4: " in refused(2, "evaluate", str(path), str(path))


def test_topics_of_a_bag_are_compared(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "a.bag", {"/truth": drive(), "/slam": drive(1.01)})
    line = refused(2, "evaluate", str(bag), str(bag))
    assert "poses on /slam, /truth; name one of them" in line
    found = ate_of(bag, bag, "--topic", "/slam", "--truth-topic", "/truth")
    plain = [tmp_path / "own.tum", tmp_path / "true.tum"]
    write_tum(plain[0], drive(1.01))
    write_tum(plain[1], drive())
    assert found == pytest.approx(ate_of(*plain), abs=1e-5)
    line = refused(2, "evaluate", str(bag), str(bag), "--topic", "/slm")
    assert "no topic '/slm', did you mean '/slam'?" in line
    assert "is no ROS bag" in refused(2, "evaluate", str(plain[0]), str(bag), "--topic", "/slam")


def test_points_have_no_rpe(tmp_path: Path) -> None:
    """Their orientation is unknown, so a relative error would mean nothing."""
    bag = write_bag(tmp_path / "a.bag", {"/prism": drive()}, points=True)
    own = write_bag(tmp_path / "b.bag", {"/slam": drive(1.01)})
    code, out, err = slambed("evaluate", str(own), str(bag))
    assert code == 0 and "ATE RMSE" in out and "RPE" not in out
    assert "points have no orientation, so there is no RPE" in err
    code, out, _ = slambed("evaluate", str(own), str(bag), "--json")
    assert json.loads(out)["rpe"] is None


def test_a_damaged_bag_is_one_line(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "a.bag", {"/slam": drive()})
    bag.write_bytes(bag.read_bytes()[:2000])
    assert str(bag) in refused(2, "evaluate", str(bag), str(bag))
    assert "no metadata.yaml" in refused(2, "evaluate", str(tmp_path), str(tmp_path))


@pytest.mark.recordings
def test_evos_own_files_equal_evo(recording: Callable[[str], Path]) -> None:
    """evo 1.38's RMSE of the same files: `evo_ape kitti -a`, `evo_ape bag -a --t_max_diff 0.02`."""
    files = recording("evo_files")
    own, true = files / "KITTI_00_ORB.txt", files / "KITTI_00_gt.txt"
    assert round(ate_of(own, true), 6) == 1.303450
    assert len(read_path(own, times=files / "KITTI_00_gt_times.txt").trajectory) == 4541
    bag = files / "ROS_example.bag"
    for topic, rmse in (("ORB-SLAM", 5.519288), ("S-PTAM", 6.353806)):
        found = ate_of(bag, bag, "--topic", topic, "--truth-topic", "groundtruth")
        assert round(found, 6) == rmse
    recorded = files / "nav2_turtlebot.mcap"
    assert "/amcl_pose, /odom" in refused(2, "evaluate", str(recorded), str(recorded))
