# SPDX-License-Identifier: Apache-2.0
"""`slambed data export`: readers of the same format read what was written."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import slambed
from data_samples import CAMERA, HEIGHT, WIDTH, gray, trajectory, write_prepared
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from slambed.data.camera_motion import CameraMotion
from slambed.data.export import export, folder_times_ns
from slambed.data.export_bag import GROUNDTRUTH, TOPICS
from slambed.data.model import Frame
from slambed.data.prepared import PreparedSequence, PreparedWriter
from slambed.data.readers import ReaderOptions, load_reader
from slambed.data.trajectory import write_tum
from slambed.errors import SlambedError

TIMES_NS = [1_000_000_000_000 + i * 100_000_000 for i in range(4)]


def options(sensor: str, **changes: Any) -> ReaderOptions:
    values = {"sensor": sensor, "size": (WIDTH, HEIGHT), "camera": CAMERA, "depth_unit_m": 0.0002}
    return ReaderOptions(**(values | {"fps": 10.0, "groundtruth": ""} | changes))


def write_stereo(path: Path, sensor: str = "stereo") -> PreparedSequence:
    with PreparedWriter(
        path,
        id="two",
        title="Two",
        sensor=sensor,
        width=WIDTH,
        height=HEIGHT,
        fps=10.0,
        camera=CAMERA,
    ) as writer:
        for i, time_ns in enumerate(TIMES_NS):
            writer.add(Frame(time_ns, gray(i), gray(100 + i) if sensor == "stereo" else None))
        writer.set_groundtruth(trajectory([999.9, 1000.15, 1000.4]))
    return PreparedSequence.open(path)


def test_tum_comes_back_as_it_was(tmp_path: Path) -> None:
    sequence = write_prepared(tmp_path / "prepared")
    folder = export(sequence, "tum", tmp_path / "out")
    reader = load_reader("tum")(folder, options("rgbd", groundtruth="groundtruth.txt"))
    assert len(reader) == len(sequence)
    for mine, theirs in zip(sequence, reader, strict=True):
        assert mine.timestamp_ns == theirs.timestamp_ns
        assert np.array_equal(mine.gray, theirs.gray)
        assert np.array_equal(mine.second, theirs.second)
    assert np.allclose(reader.trajectory().rows(), sequence.groundtruth().rows(), atol=1e-6)


def test_kitti_comes_back_with_its_camera(tmp_path: Path) -> None:
    sequence = write_stereo(tmp_path / "prepared")
    folder = export(sequence, "kitti", tmp_path / "out")
    reader = load_reader("kitti")(folder, options("stereo", groundtruth="poses.txt"))
    assert reader.camera() == CAMERA and len(reader) == 4
    for mine, theirs in zip(sequence, reader, strict=True):
        assert mine.timestamp_ns - TIMES_NS[0] == theirs.timestamp_ns
        assert np.array_equal(mine.gray, theirs.gray)
        assert np.array_equal(mine.second, theirs.second)
    found = reader.trajectory()
    assert found is not None
    # The walk moves 0.1 m/s along x; its poses are interpolated between the true ones.
    assert np.allclose(np.diff(found.positions_m[:, 0]), 0.01, atol=1e-6)


@pytest.mark.parametrize(
    ("stamps_s", "frames", "first_s"),
    [
        ([1000.0, 1000.1], 2, "0.200"),  # until the last true pose
        ([1000.15, 1000.2, 1000.3], 2, "0.000"),  # from the first one
        ([999.9, 1000.1, 1000.4], 2, "0.200"),  # a long gap
    ],
)
def test_kitti_gets_no_pose_that_was_not_measured(
    tmp_path: Path, stamps_s: list[float], frames: int, first_s: str
) -> None:
    sequence = write_stereo(tmp_path / "prepared")
    file = sequence.groundtruth_file
    assert file is not None
    write_tum(file, trajectory(stamps_s))
    line = f"no pose for {frames} of 4 frames, the first at {first_s} s.*take euroc or mcap"
    with pytest.raises(SlambedError, match=line):
        export(sequence, "kitti", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    # Of the frames that have one, the poses are written.
    known = np.array([1] if stamps_s[0] < 1000.1 else [2, 3])
    folder = export(sequence, "kitti", tmp_path / "out", indices=known)
    assert len((folder / "poses.txt").read_text().splitlines()) == len(known)


def test_euroc_keeps_times_poses_and_baseline(tmp_path: Path) -> None:
    sequence = write_stereo(tmp_path / "prepared")
    folder = export(sequence, "euroc", tmp_path / "out")
    reader = load_reader("euroc")(folder, options("stereo"))
    assert [frame.timestamp_ns for frame in reader] == TIMES_NS
    assert reader.camera().bf == pytest.approx(CAMERA.bf)
    truth, found = sequence.groundtruth(), reader.trajectory()
    assert truth is not None and found is not None
    assert np.allclose(found.positions_m, truth.positions_m, atol=1e-6)
    # Already rectified: the reader's rectification moves no pixel.
    assert np.array_equal(reader[2].gray[2:-2, 2:-2], sequence.gray(2)[2:-2, 2:-2])


@pytest.mark.parametrize("sensor", ["mono", "rgbd", "stereo"])
def test_a_bag_comes_back_as_it_was(tmp_path: Path, sensor: str) -> None:
    sequence = (
        write_prepared(tmp_path / "prepared")
        if sensor == "rgbd"
        else write_stereo(tmp_path / "prepared", sensor)
    )
    folder = export(sequence, "mcap", tmp_path / "out")
    assert sorted(p.name for p in folder.iterdir()) == ["metadata.yaml", "out.mcap"]
    names = ("first_topic", "second_topic")
    topics = dict(zip(names, TOPICS[sensor], strict=False)) | {"groundtruth_topic": GROUNDTRUTH}
    for place in (folder, folder / "out.mcap"):
        reader = load_reader("bag")(place, options(sensor, extra=topics))
        assert len(reader) == len(sequence) == 4
        for mine, theirs in zip(sequence, reader, strict=True):
            assert mine.timestamp_ns == theirs.timestamp_ns
            assert np.array_equal(mine.gray, theirs.gray)
            assert (mine.second is None) == (theirs.second is None)
            assert mine.second is None or np.array_equal(mine.second, theirs.second)
        truth, found = sequence.groundtruth(), reader.trajectory()
        assert truth is not None and found is not None
        assert np.allclose(found.rows(), truth.rows(), rtol=0, atol=1e-9)


def messages(folder: Path) -> dict[str, list[Any]]:
    """Returns the messages by topic, as any ROS program would read them."""
    found: dict[str, list[Any]] = {}
    with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        for connection, _, raw in bag.messages():
            message = bag.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append(message)
    return found


def test_a_bag_says_what_its_cameras_are(tmp_path: Path) -> None:
    stereo = messages(export(write_stereo(tmp_path / "a"), "mcap", tmp_path / "out"))
    left, right = stereo["/left/camera_info"], stereo["/right/camera_info"]
    assert len(left) == len(right) == 4
    assert left[2].header == stereo["/left/image_raw"][2].header
    assert (left[0].width, left[0].height) == (WIDTH, HEIGHT)
    assert left[0].k.tolist() == [50.0, 0, 31.5, 0, 50.0, 23.5, 0, 0, 1]
    assert left[0].p.tolist() == [50.0, 0, 31.5, 0, 0, 50.0, 23.5, 0, 0, 0, 1, 0]
    assert right[0].p[3] == -CAMERA.bf
    assert [m.encoding for m in stereo["/left/image_raw"]] == ["mono8"] * 4


@pytest.mark.parametrize(("unit_m", "encoding"), [(0.0002, "32FC1"), (0.001, "16UC1")])
def test_depth_is_in_meters_or_in_whole_millimeters(
    tmp_path: Path, unit_m: float, encoding: str
) -> None:
    with PreparedWriter(
        tmp_path / "prepared",
        id="deep",
        title="Deep",
        sensor="rgbd",
        width=WIDTH,
        height=HEIGHT,
        fps=10.0,
        camera=CAMERA,
        depth_unit_m=unit_m,
    ) as writer:
        steps = np.arange(WIDTH * HEIGHT, dtype=np.uint16).reshape(HEIGHT, WIDTH) * 21
        writer.add(Frame(TIMES_NS[0], gray(0), steps))
    sequence = PreparedSequence.open(tmp_path / "prepared")
    folder = export(sequence, "mcap", tmp_path / "out")
    found = messages(folder)
    (image,) = found["/camera/depth/image_raw"]
    assert image.encoding == encoding and GROUNDTRUTH not in found
    if encoding == "32FC1":
        meters = image.data.view("<f4").reshape(HEIGHT, WIDTH)
        assert np.isnan(meters[0, 0]) and meters[0, 5] == pytest.approx(105 * unit_m)
    topics = {"first_topic": TOPICS["rgbd"][0], "second_topic": TOPICS["rgbd"][1]}
    reader = load_reader("bag")(folder, options("rgbd", depth_unit_m=unit_m, extra=topics))
    (frame,) = reader
    assert np.array_equal(frame.second, steps)


def test_a_layout_that_cannot_hold_the_sequence_is_refused(tmp_path: Path) -> None:
    mono = write_stereo(tmp_path / "mono", "mono")
    with pytest.raises(SlambedError, match="is mono, which tum does not hold; take kitti or mcap"):
        export(mono, "tum", tmp_path / "out")
    with pytest.raises(SlambedError, match="unknown format 'ros'"):
        export(mono, "ros", tmp_path / "out")
    export(mono, "kitti", tmp_path / "out")
    with pytest.raises(SlambedError, match="is there already"):
        export(mono, "kitti", tmp_path / "out")
    (tmp_path / "file").touch()
    with pytest.raises(SlambedError, match="choose another folder"):
        export(mono, "mcap", tmp_path / "file" / "inside")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "mono", "out"]


def test_the_command_writes_a_folder(tmp_path: Path) -> None:
    write_prepared(tmp_path / "prepared")
    output = tmp_path / "mine"
    code, out, err = slambed(
        "data", "export", str(tmp_path / "prepared"), "--format", "tum", "--output", str(output)
    )
    assert code == 0, err
    assert out.startswith(f"{output}: 4 frames") and (output / "rgb.txt").is_file()


@pytest.mark.parametrize("layout", ["kitti", "euroc"])
def test_a_part_has_its_frames_its_rate_and_no_truth(tmp_path: Path, layout: str) -> None:
    sequence = write_stereo(tmp_path / "prepared")
    folder = export(sequence, layout, tmp_path / "out", indices=np.array([1, 3]), with_truth=False)
    reader = load_reader(layout)(folder, options("stereo"))
    assert [frame.timestamp_ns for frame in reader] == [
        int(folder_times_ns(sequence, layout)[i]) for i in (1, 3)
    ]
    assert np.array_equal(reader[1].gray[2:-2, 2:-2], sequence.gray(3)[2:-2, 2:-2])
    names = {path.name for path in folder.rglob("*")}
    assert not names & {"poses.txt", "groundtruth.txt", "state_groundtruth_estimate0"}
    if layout == "euroc":
        assert "rate_hz: 5\n" in (folder / "mav0" / "cam0" / "sensor.yaml").read_text()


def test_kitti_gets_pictures_without_the_distortion_of_their_lens(tmp_path: Path) -> None:
    """Its calibration has no place for one."""
    bent = CAMERA.model_copy(update={"distortion": (0.3, 0.0, 0.0, 0.0, 0.0)})
    ramp = np.tile(np.arange(WIDTH, dtype=np.uint8) * 4, (HEIGHT, 1))
    with PreparedWriter(
        tmp_path / "bent",
        id="bent",
        title="Bent",
        sensor="mono",
        width=WIDTH,
        height=HEIGHT,
        fps=10.0,
        camera=bent,
    ) as writer:
        writer.add(Frame(TIMES_NS[0], ramp, None))
    folder = export(PreparedSequence.open(tmp_path / "bent"), "kitti", tmp_path / "out")
    (frame,) = load_reader("kitti")(folder, options("mono"))
    row = HEIGHT // 2
    column = 56
    # A pixel at x shows what the lens bent to x (1 + k1 r^2).
    x = (column - CAMERA.cx) / CAMERA.fx
    r2 = x**2 + ((row - CAMERA.cy) / CAMERA.fy) ** 2
    bent_to = CAMERA.fx * x * (1 + 0.3 * r2) + CAMERA.cx
    assert bent_to - column > 1.5
    assert frame.gray[row, column] == pytest.approx(4 * bent_to, abs=2)


@pytest.mark.parametrize("layout", ["euroc", "kitti", "mcap"])
def test_positions_alone_are_not_exported_as_poses(tmp_path: Path, layout: str) -> None:
    sequence = write_stereo(tmp_path / "prepared")
    file = sequence.groundtruth_file
    assert file is not None
    truth = replace(trajectory([999.9, 1000.15, 1000.4]), has_orientation=False)
    write_tum(file, truth)
    with pytest.raises(SlambedError, match=f"has positions alone, and {layout} holds poses"):
        export(sequence, layout, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    with pytest.raises(SlambedError, match="positions alone, and where points go"):
        CameraMotion.of(sequence)
