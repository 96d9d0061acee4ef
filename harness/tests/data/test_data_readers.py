# SPDX-License-Identifier: Apache-2.0
"""Readers of recorded datasets, on folders and bags created here."""

from __future__ import annotations

import shutil
from decimal import Decimal
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from data_samples import CAMERA, HEIGHT, WIDTH, depth, gray, one_line, write_tum
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from slambed.data.association import pairs_of_sensors
from slambed.data.model import Camera
from slambed.data.readers import ReaderOptions, load_reader, reader_names
from slambed.data.stamps import number_or_date
from slambed.errors import SlambedError


def options(**changes: Any) -> ReaderOptions:
    values = {
        "sensor": "rgbd",
        "size": (WIDTH, HEIGHT),
        "camera": CAMERA,
        "depth_unit_m": 0.0002,
        "fps": 10.0,
    }
    return ReaderOptions(**(values | changes))


def test_association_takes_the_closest_pairs_first() -> None:
    ms = 1_000_000
    first = [0, 30 * ms, 60 * ms]
    second = [12 * ms, 31 * ms, 65 * ms, 200 * ms]  # 0-12, 30-31, 60-65; 200 has no partner
    assert pairs_of_sensors(first, second) == [(0, 0), (1, 1), (2, 2)]
    assert pairs_of_sensors(first, second, 1e300) == [(0, 0), (1, 1), (2, 2)]
    assert pairs_of_sensors(first, [15 * ms + 1, 29 * ms]) == [(0, 0), (1, 1)]
    assert pairs_of_sensors([0, 10 * ms], [9 * ms]) == [(1, 0)]
    assert pairs_of_sensors([0], [20 * ms - 1]) == [(0, 0)]
    assert pairs_of_sensors([0], [20 * ms]) == []  # strictly less, like the benchmark's script
    assert pairs_of_sensors([], []) == []


def test_readers_are_found_by_module_name() -> None:
    assert {"tum", "seven_scenes", "kitti", "euroc", "bag"} <= set(reader_names())
    with pytest.raises(SlambedError, match="did you mean 'tum'"):
        load_reader("tun")
    with pytest.raises(SlambedError, match="unknown key 'max_diference_s', did you mean"):
        load_reader("tum")(Path(), options(extra={"max_diference_s": 1}))


def test_tum(tmp_path: Path) -> None:
    reader = load_reader("tum")(write_tum(tmp_path / "t"), options(groundtruth="groundtruth.txt"))
    frames = list(reader)
    assert len(reader) == len(frames) == 5  # one depth image is missing
    assert frames[0].timestamp_ns == 1305031102_175304000
    assert np.array_equal(frames[3].gray, gray(4))
    assert np.array_equal(frames[3].second, depth(4))
    truth = reader.trajectory()
    assert truth is not None and len(truth) == 6


def test_tum_with_one_camera_takes_every_color_image(tmp_path: Path) -> None:
    folder = write_tum(tmp_path / "t")
    (folder / "depth.txt").unlink()
    reader = load_reader("tum")(folder, options(sensor="mono", groundtruth="groundtruth.txt"))
    assert len(reader) == 6 and all(frame.second is None for frame in reader)
    assert np.array_equal(reader[2].gray, gray(2)) and reader.trajectory() is not None
    assert not any("depth" in str(file) for file in reader.files())


def test_tum_without_pairs(tmp_path: Path) -> None:
    folder = write_tum(tmp_path / "t")
    (folder / "depth.txt").write_text("5.0 depth/x.png\n")
    with pytest.raises(SlambedError) as error:
        load_reader("tum")(folder, options())
    assert "within 0.02 s" in one_line(error)
    (folder / "depth.txt").write_text("5.0\n")
    with pytest.raises(SlambedError, match=r"depth\.txt:1"):
        load_reader("tum")(folder, options())


@pytest.mark.parametrize("kind", ["truncated", "empty", "garbage", "missing", "8 bit", "size"])
def test_a_bad_image_is_named(tmp_path: Path, kind: str) -> None:
    folder = write_tum(tmp_path / "t")
    victim = sorted((folder / "depth").iterdir())[2]
    content = victim.read_bytes()
    match kind:
        case "truncated":
            victim.write_bytes(content[: len(content) // 2])
        case "empty":
            victim.write_bytes(b"")
        case "garbage":
            victim.write_bytes(content[:40] + bytes(len(content) - 52) + content[-12:])
        case "missing":
            victim.unlink()
        case "8 bit":
            cv2.imwrite(str(victim), gray(0))
        case "size":
            cv2.imwrite(str(victim), np.ones((10, 10), dtype=np.uint16))
    with pytest.raises(SlambedError) as error:
        list(load_reader("tum")(folder, options()))
    assert str(victim) in one_line(error)


def write_seven_scenes(folder: Path) -> None:
    folder.mkdir()
    for i in range(3):
        cv2.imwrite(str(folder / f"frame-{i:06}.color.png"), gray(i))
        plane = depth(i, unit_m=0.001)
        plane[1] = 65535  # no measurement
        cv2.imwrite(str(folder / f"frame-{i:06}.depth.png"), plane)
        pose = np.eye(4)
        pose[0, 3] = i
        np.savetxt(folder / f"frame-{i:06}.pose.txt", pose)


def test_seven_scenes(tmp_path: Path) -> None:
    folder = tmp_path / "seq-01"
    write_seven_scenes(folder)
    reader = load_reader("seven_scenes")(tmp_path, options(extra={"sequence": "seq-01"}))
    frames = list(reader)
    assert [frame.timestamp_ns for frame in frames] == [0, 100_000_000, 200_000_000]
    assert frames[1].second is not None and not frames[1].second[1].any()
    truth = reader.trajectory()
    assert truth is not None and list(truth.rows()[2, :4]) == pytest.approx([0.2, 2, 0, 0])
    (folder / "frame-000001.pose.txt").write_text("1 2 3")
    with pytest.raises(SlambedError, match=r"000001\.pose\.txt"):
        reader.trajectory()


def test_a_pose_that_was_lost_is_left_out_and_reported(tmp_path: Path) -> None:
    """As ScanNet writes it."""
    write_seven_scenes(tmp_path / "s")
    np.savetxt(tmp_path / "s/frame-000001.pose.txt", np.full((4, 4), -np.inf))
    reader: Any = load_reader("seven_scenes")(tmp_path / "s", options())
    assert reader.trajectory().stamps_s.tolist() == pytest.approx([0, 0.2])
    assert "000001.pose.txt: not finite, tracking was lost: 1 of 3 frames" in reader.notes[0]
    np.savetxt(tmp_path / "s/frame-000001.pose.txt", 2 * np.eye(4))
    with pytest.raises(SlambedError, match=r"000001.pose.txt: not a rotation"):
        reader.trajectory()


def test_seven_scenes_with_a_missing_frame_goes_by_numbers(tmp_path: Path) -> None:
    write_seven_scenes(tmp_path / "s")
    for file in (tmp_path / "s").glob("frame-000001.*"):
        file.unlink()
    reader: Any = load_reader("seven_scenes")(tmp_path / "s", options())
    assert reader.times_ns() == [0, 200_000_000] and reader[1].timestamp_ns == 200_000_000
    assert reader.trajectory().stamps_s.tolist() == pytest.approx([0, 0.2])
    assert "1 images are missing, the first is number 1" in reader.notes[0]


def write_kitti(root: Path, right: bool = True) -> Path:
    folder = root / "sequences/07"
    for side in (0, 1) if right else (0,):
        (folder / f"image_{side}").mkdir(parents=True)
        for i in range(3):
            cv2.imwrite(str(folder / f"image_{side}/{i:06}.png"), gray(10 * side + i))
    (folder / "times.txt").write_text("0.0\n1.038752e-01\n2.079e-01\n")
    p0 = "700 0 31 0 0 700 23 0 0 0 1 0"
    (folder / "calib.txt").write_text(f"P0: {p0}\nP1: {p0.replace('31 0', '31 -380')}\n")
    (root / "poses").mkdir()
    (root / "poses/07.txt").write_text("".join(f"1 0 0 0 0 1 0 0 0 0 1 {i}\n" for i in range(5)))
    return folder


def test_kitti(tmp_path: Path) -> None:
    changes = {"sensor": "stereo", "size": None, "camera": None, "groundtruth": "07.txt"}
    reader = load_reader("kitti")(write_kitti(tmp_path), options(**changes))
    frames = list(reader)
    assert reader.size() == (WIDTH, HEIGHT)
    assert (reader.camera().fx, reader.camera().cx, reader.camera().bf) == (700, 31, 380)
    assert frames[1].timestamp_ns == 103_875_200
    assert np.array_equal(frames[2].second, gray(12))
    truth = reader.trajectory()
    assert truth is not None and len(truth) == 3 and truth.positions_m[2, 2] == 2


def kitti(folder: Path, **changes: Any) -> Any:
    values = {"sensor": "stereo", "size": None, "camera": None, "groundtruth": "07.txt"}
    return load_reader("kitti")(folder, options(**(values | changes)))


def test_kitti_with_a_missing_image_goes_by_numbers(tmp_path: Path) -> None:
    folder = write_kitti(tmp_path)
    for side in (0, 1):
        (folder / f"image_{side}/000001.png").unlink()
    reader = kitti(folder)
    assert reader.times_ns() == [0, 207_900_000] and reader[1].timestamp_ns == 207_900_000
    assert reader.trajectory().positions_m[:, 2].tolist() == [0, 2]
    assert "1 images are missing, the first is number 1" in reader.notes[0]
    (folder / "times.txt").write_text("0.0\n0.2\n0.3\n0.4\n0.5\n")
    (tmp_path / "poses/07.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n")
    with pytest.raises(SlambedError, match=r"1 poses for 2 images, the last is 000002.png"):
        kitti(folder).trajectory()


def test_kitti_with_dates_headers_and_commas(tmp_path: Path) -> None:
    folder = write_kitti(tmp_path)
    expected = kitti(folder).trajectory()
    dates = [f"2011-09-26 13:02:25.{i}94360375" for i in range(3)]
    (folder / "times.txt").write_text("\r\n".join(dates))
    poses = (tmp_path / "poses/07.txt").read_text().replace(" ", ", ")
    (tmp_path / "poses/07.txt").write_text("r11, r12, r13\n" + poses)
    reader = kitti(folder)
    assert reader.times_ns()[0] == 1317042145_094360375
    assert np.array_equal(reader.trajectory().positions_m, expected.positions_m)


@pytest.mark.parametrize(
    ("date", "since_1970"),
    [
        ("2020-01-01T00:00:00+01:00", "1577833200"),
        ("2020-01-01 00:00:00.123456789+01:00", "1577833200.123456789"),
        ("2020-01-01T00:00:00.5Z", "1577836800.5"),
        ("2020-01-01T00:00:00,5-0530", "1577856600.5"),
        ("2020-01-01T00:00:00.964389445", "1577836800.964389445"),
    ],
)
def test_the_time_zone_of_a_date_counts(date: str, since_1970: str) -> None:
    assert number_or_date(date) == Decimal(since_1970)
    for wrong in (f"{date}x", date[:10] + ".5+", "2020-01-01T00:00:00.5 5", "1611120512304,5"):
        with pytest.raises(ValueError, match=r"not a time|isoformat"):
            number_or_date(wrong)


@pytest.mark.parametrize(
    ("file", "text", "complaint"),
    [
        ("calib.txt", "P0: 1 2 x\n", r"calib.txt:1: .*'x', expected 12 numbers"),
        ("calib.txt", "P0: 1 2 3\n", r"calib.txt:1: 3 values, expected 12 numbers"),
        ("calib.txt", "", r"calib.txt: no line P0"),
        ("calib.txt", "P0: 7 5 3 0 0 7 2 0 0 0 1 0\n", r"calib.txt:1: P0 has the skew 5"),
        (
            "calib.txt",
            "P0: 7 0 3 0 0 7 2 0 0 0 2 0\n",
            r"calib.txt:1: the last row of P0 is 0 0 2 0",
        ),
        ("times.txt", "0\nsoon\n1\n", r"times.txt:2: 'soon' is not a time, expected seconds"),
        ("times.txt", "0\n1\n", "2 times for 3 images"),
        ("times.txt", "0\n1e400\n1\n", r"times.txt:2: '1e400' is not a time"),
        ("poses", "1 0 0 0 0 1 0 0 0 0 1 0\n" * 2 + "1 2\n", r"07.txt:3: not a pose: 2 values"),
        (
            "poses",
            "1 0 0 0 0 1 0 0 0 0 1 nan\n" * 3,
            r"07.txt:1: not a pose: 'nan' is not a number",
        ),
        ("poses", "2 0 0 0 0 2 0 0 0 0 2 0\n" * 3, r"07.txt:1: not a rotation"),
        ("poses", "1 0 0 0 0 1 0 0 0 0 -1 0\n" * 3, r"07.txt:1: a mirror image"),
    ],
)
def test_a_bad_line_of_kitti_is_named(tmp_path: Path, file: str, text: str, complaint: str) -> None:
    folder = write_kitti(tmp_path)
    path = tmp_path / "poses/07.txt" if file == "poses" else folder / file
    path.write_text(text)
    with pytest.raises(SlambedError, match=complaint) as error:
        reader = kitti(folder)
        reader.camera()
        reader.trajectory()
    one_line(error)


@pytest.mark.parametrize("fourth", [0, 380])
def test_a_rig_without_baseline_or_the_wrong_way_round(tmp_path: Path, fourth: int) -> None:
    folder = write_kitti(tmp_path)
    text = (folder / "calib.txt").read_text().replace("-380", str(fourth))
    (folder / "calib.txt").write_text(text)
    with pytest.raises(SlambedError, match=f"calib.txt:2: the fourth number of P1 is {fourth}"):
        kitti(folder).camera()


def test_what_a_format_cannot_hold_is_refused(tmp_path: Path) -> None:
    folder = write_kitti(tmp_path)
    with pytest.raises(SlambedError, match="holds stereo or mono, not rgbd"):
        kitti(folder, sensor="rgbd")
    with pytest.raises(SlambedError, match=r"08.txt is missing .ground truth."):
        list(kitti(folder, groundtruth="08.txt").files())
    with pytest.raises(SlambedError, match="'distortion' of the dataset's camera is not used"):
        kitti(folder, distortion=(0.1, 0.0, 0.0, 0.0))
    with pytest.raises(SlambedError, match=r"'groundtruth: a.txt' is not used by this reader"):
        load_reader("bag")(tmp_path, options(groundtruth="a.txt"))


def test_kitti_left_only(tmp_path: Path) -> None:
    folder = write_kitti(tmp_path, right=False)
    mono = load_reader("kitti")(folder, options(sensor="mono", camera=None, size=None))
    assert next(iter(mono)).second is None
    text = (folder / "calib.txt").read_text()
    for calibration, bf in (
        (text, 380), (text.replace("-380", "380"), 0), (text.partition("P1")[0], 0)
    ):  # fmt: skip
        (folder / "calib.txt").write_text(calibration)
        assert (mono.camera().fx, mono.camera().bf) == (700, bf)
    with pytest.raises(SlambedError, match="image_1"):
        load_reader("kitti")(folder, options(sensor="stereo"))


EUROC_SENSORS = {  # published calibration of V1_01 and MH_01
    "cam0": (
        [458.654, 457.296, 367.215, 248.375],
        [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05],
        [0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975,
         0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768,
         -0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949,
         0.0, 0.0, 0.0, 1.0],
    ),
    "cam1": (
        [457.587, 456.134, 379.999, 255.238],
        [-0.28368365, 0.07451284, -0.00010473, -3.55590700e-05],
        [0.0125552670891, -0.999755099723, 0.0182237714554, -0.0198435579556,
         0.999598781151, 0.0130119051815, 0.0251588363115, 0.0453689425024,
         -0.0253898008918, 0.0179005838253, 0.999517347078, 0.00786212447038,
         0.0, 0.0, 0.0, 1.0],
    ),
}  # fmt: skip


def write_euroc(root: Path) -> Path:
    for name, (intrinsics, distortion, body) in EUROC_SENSORS.items():
        folder = root / "mav0" / name
        (folder / "data").mkdir(parents=True)
        (folder / "sensor.yaml").write_text(
            f"resolution: [752, 480]\nintrinsics: {intrinsics}\n"
            f"distortion_coefficients: {distortion}\nT_BS:\n  data: {body}\n"
        )
        stamps = [1403636579763555584, 1403636579813555456]
        rows = [f"{stamp},{stamp}.png" for stamp in stamps]
        (folder / "data.csv").write_text("#timestamp [ns],filename\n" + "\n".join(rows) + "\n")
        for stamp in stamps:
            cv2.imwrite(str(folder / f"data/{stamp}.png"), gray(1, 752, 480))
    truth = root / "mav0/state_groundtruth_estimate0"
    truth.mkdir()
    (truth / "data.csv").write_text("#t,x,y,z,qw,qx,qy,qz\n1403636579763555584,1,2,3,1,0,0,0,9\n")
    return root


def test_euroc_rectifies_to_the_camera_orb_slam2_uses(tmp_path: Path) -> None:
    wanted = Camera(fx=435.2046959714599, fy=435.2046959714599, cx=367.45, cy=252.20, bf=47.906)
    folder = write_euroc(tmp_path)
    reader = load_reader("euroc")(folder, options(sensor="stereo", camera=wanted))
    # bf comes from the baseline of the calibration and must agree with the published 47.90639.
    assert reader.camera().bf == pytest.approx(47.90639384423901, abs=1e-4)
    assert reader.camera().cx == wanted.cx
    # Without a camera OpenCV chooses a similar one.
    own = load_reader("euroc")(folder, options(sensor="stereo", camera=None)).camera()
    assert own.fx == pytest.approx(435, abs=25) and own.bf / own.fx == pytest.approx(0.11, abs=1e-3)
    frames = list(reader)
    assert len(frames) == 2 and frames[0].gray.shape == (480, 752)
    assert frames[0].timestamp_ns == 1403636579763555584
    truth = reader.trajectory()
    assert truth is not None
    # The body does not rotate: the camera is at its mounting position, looking along the body's z
    # axis.
    assert truth.positions_m[0] == pytest.approx([1 - 0.02164, 2 - 0.06468, 3 + 0.00981], abs=1e-4)


def euroc(folder: Path, **changes: Any) -> Any:
    values = {"sensor": "stereo", "camera": None, "size": None}
    return load_reader("euroc")(folder, options(**(values | changes)))


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def test_euroc_with_one_camera(tmp_path: Path) -> None:
    folder = write_euroc(tmp_path)
    shutil.rmtree(folder / "mav0/cam1")
    reader = euroc(folder, sensor="mono")
    frame = reader[0]
    assert frame.second is None and frame.gray.shape == (480, 752)
    assert (reader.camera().fx, reader.camera().cx, reader.camera().bf) == (458.654, 367.215, 0)
    # cam0 keeps its orientation on the body, without a rectifying rotation.
    assert reader.trajectory().positions_m[0] == pytest.approx([0.97836, 1.93532, 3.00981], 1e-4)


@pytest.mark.parametrize("unit", ["s", "us"])
def test_euroc_in_another_unit_of_time(tmp_path: Path, unit: str) -> None:
    folder = write_euroc(tmp_path)
    for name in ("cam0", "cam1"):
        file = folder / "mav0" / name / "data.csv"
        for stamp in (1403636579763555584, 1403636579813555456):
            other = f"{stamp / 1e9:.6f}" if unit == "s" else str(stamp // 1000)
            edit(file, f"{stamp},", f"{other},")
        edit(file, "#timestamp", "timestamp")
    reader = euroc(folder)
    assert reader.times_ns()[0] == pytest.approx(1403636579763555584, abs=1000)
    assert len(reader) == 2 and "are read as" in reader.notes[0]


def test_motion_capture_of_tum_vi(tmp_path: Path) -> None:
    folder = write_euroc(tmp_path)
    expected = euroc(folder).trajectory()
    (folder / "mav0/state_groundtruth_estimate0").rename(folder / "mav0/mocap0")
    reader = euroc(folder)
    assert np.array_equal(reader.trajectory().rows(), expected.rows())
    assert "mocap0/data.csv: taken as ground truth" in reader.notes[0]
    asked = euroc(folder, groundtruth="mocap0/data.csv")
    assert asked.trajectory() is not None and not asked.notes
    with pytest.raises(SlambedError, match=r"vicon0/data.csv is missing"):
        list(euroc(folder, groundtruth="vicon0/data.csv").files())


def test_an_equidistant_rig_is_rectified_by_its_model(tmp_path: Path) -> None:
    folder = write_euroc(tmp_path)
    plain = euroc(folder)[0]
    for name in ("cam0", "cam1"):
        file = folder / "mav0" / name / "sensor.yaml"
        file.write_text(file.read_text() + "distortion_model: equidistant\n")
    reader = euroc(folder)
    assert not np.array_equal(reader[0].gray, plain.gray)
    left, right = (sensor.lens for sensor in reader._sensors)
    poses = [sensor.pose for sensor in reader._sensors]
    point = np.array([0.3, -0.2, 3.0])  # in the frame of cam0
    seen = []
    for lens, pose, maps in zip((left, right), poses, reader._maps, strict=True):
        own = np.linalg.inv(pose) @ poses[0] @ np.append(point, 1)
        turn = np.zeros(3)
        raw, _ = cv2.fisheye.projectPoints(
            own[:3].reshape(1, 1, 3), turn, turn, lens.matrix, lens.coefficients
        )
        distance = (maps[0] - raw[0, 0, 0]) ** 2 + (maps[1] - raw[0, 0, 1]) ** 2
        seen.append(np.unravel_index(int(distance.argmin()), distance.shape))
    (row, column), (right_row, right_column) = seen
    camera = reader.camera()
    assert abs(int(row) - int(right_row)) <= 1
    depth_m = camera.bf / (int(column) - int(right_column))
    assert depth_m == pytest.approx(3.0, rel=0.05)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("T_BS", "distortion_model: omni\nT_BS", "distortion model 'omni' is not supported"),
        ("T_BS", "camera_model: omni\nT_BS", "camera model 'omni' is not supported"),
        ("0.0148655429818", "0.7", "T_BS: not a rotation"),
        ("distortion_coefficients: [", "distortion_coefficients: [1, 2, ", "6 numbers of radial"),
        (
            "intrinsics: [458.654",
            "intrinsics: [-1",
            "intrinsics -1 457.296 .*lengths above 0",
        ),
        ("intrinsics", "intrinsic", "key 'intrinsics' is missing"),
        ("resolution: [752, 480]", "resolution: none", "not an ASL sensor.yaml"),
        ("resolution", "cam0: {", "not YAML"),
        ("resolution", "cam0: 1\nresolution", "this is a Kalibr camchain.*import-camera"),
        ("resolution", "camera_matrix: 1\nresolution", "an OpenCV or ROS calibration.*import"),
    ],
)
def test_a_bad_calibration_is_named(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    file = write_euroc(tmp_path) / "mav0/cam0/sensor.yaml"
    edit(file, old, new)
    with pytest.raises(SlambedError, match=complaint) as error:
        euroc(tmp_path)
    assert str(file) in one_line(error)


def test_rigs_that_are_not_side_by_side(tmp_path: Path) -> None:
    folder = write_euroc(tmp_path)
    left, right = (folder / f"mav0/cam{i}/sensor.yaml" for i in (0, 1))
    before = right.read_text()
    edit(right, str(EUROC_SENSORS["cam1"][2]), str(EUROC_SENSORS["cam0"][2]))
    with pytest.raises(SlambedError, match="cam1 is 0 mm to the right of cam0"):
        euroc(folder)
    right.write_text(left.read_text())
    left.write_text(before)
    with pytest.raises(SlambedError, match=r"cam1 is -110.* mm to the right of cam0.*swap"):
        euroc(folder)


def test_a_quaternion_in_wrong_columns(tmp_path: Path) -> None:
    folder = write_euroc(tmp_path)
    edit(folder / "mav0/state_groundtruth_estimate0/data.csv", "1,0,0,0,9", "1,1,1,0,9")
    with pytest.raises(SlambedError, match=r"data.csv:2: not a rotation: the quaternion has"):
        euroc(folder).trajectory()


def ros_image(store: Any, ns: int, plane: np.ndarray[Any, Any], encoding: str) -> Any:
    types = store.types
    header_type = types["std_msgs/msg/Header"]
    stamp = types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
    fields = {"stamp": stamp, "frame_id": "camera"}
    if "seq" in header_type.__dataclass_fields__:
        fields["seq"] = 0
    padded = np.zeros((plane.shape[0], plane[0].nbytes + 8), np.uint8)  # rows may be padded
    padded[:, :-8] = np.ascontiguousarray(plane).view(np.uint8).reshape(plane.shape[0], -1)
    return types["sensor_msgs/msg/Image"](
        header=header_type(**fields),
        height=plane.shape[0],
        width=plane.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=padded.shape[1],
        data=padded.reshape(-1),
    )


def write_bag(path: Path, kind: str) -> Path:
    """Color as rgb8, depth as meters; a depth image comes before its color image once."""
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    if kind == "ros1":
        writer: Any = Writer1(path)
    else:
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
    with writer:
        image = "sensor_msgs/msg/Image"
        color = writer.add_connection("/rgb", image, typestore=store)
        meters = writer.add_connection("/depth", image, typestore=store)
        for i in range(4):
            ns = 50_000_000_000 + i * 33_000_000
            rgb = np.repeat(gray(i)[:, :, None], 3, axis=2)
            plane = depth(i).astype(np.float32) * np.float32(0.0002)
            plane[plane == 0] = np.nan
            pair = [(color, ros_image(store, ns, rgb, "rgb8"))]
            pair.insert(0 if i == 2 else 1, (meters, ros_image(store, ns + 500, plane, "32FC1")))
            for k, (connection, message) in enumerate(pair):
                serialize = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
                writer.write(connection, ns + k, serialize(message, image))
    return path


BAG_TOPICS = {"first_topic": "/rgb", "second_topic": "/depth"}


@pytest.mark.parametrize("kind", ["ros1", "ros2", "mcap"])
def test_bags(tmp_path: Path, kind: str) -> None:
    bag = write_bag(tmp_path / ("b.bag" if kind == "ros1" else "b"), kind)
    reader = load_reader("bag")(bag, options(extra=BAG_TOPICS))
    frames = list(reader)
    assert len(reader) == len(frames) == 4
    assert [f.timestamp_ns for f in frames] == [50_000_000_000 + i * 33_000_000 for i in range(4)]
    for i, frame in enumerate(frames):
        assert np.array_equal(frame.gray, gray(i))
        assert np.array_equal(frame.second, depth(i))


def test_a_bare_mcap_file_is_read(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "b", "mcap")
    file = next(folder.glob("*.mcap"))
    assert len(load_reader("bag")(file, options(extra=BAG_TOPICS))) == 4


def test_an_mcap_that_a_crash_cut_off(tmp_path: Path) -> None:
    file = next(write_bag(tmp_path / "b", "mcap").glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(SlambedError, match=r"cut off, as a crash leaves it; .*'mcap recover'"):
        len(load_reader("bag")(file, options(extra=BAG_TOPICS)))


def test_a_bag_of_ros2_may_be_called_dot_bag(tmp_path: Path) -> None:
    """A folder is one of ROS 2, whatever its name."""
    plain = write_bag(tmp_path / "plain", "ros2")
    named = plain.rename(tmp_path / "walk.bag")
    assert named.is_dir()
    reader = load_reader("bag")(named, options(sensor="mono", extra={"first_topic": "/rgb"}))
    assert len(reader) and [frame.timestamp_ns for frame in reader] == reader.times_ns()
    (tmp_path / "empty.bag").mkdir()
    with pytest.raises(SlambedError, match=r"empty\.bag: cannot be read as a bag"):
        len(
            load_reader("bag")(
                tmp_path / "empty.bag", options(sensor="mono", extra={"first_topic": "/rgb"})
            )
        )


def test_bag_errors(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "b.bag", "ros1")
    wrong = {"first_topic": "/rbg", "second_topic": "/depth"}
    with pytest.raises(SlambedError) as error:
        len(load_reader("bag")(bag, options(extra=wrong)))
    assert "no topic '/rbg', did you mean '/rgb'?" in one_line(error)
    swapped = {"first_topic": "/depth", "second_topic": "/rgb"}
    with pytest.raises(SlambedError, match="swap the topics"):
        list(load_reader("bag")(bag, options(extra=swapped)))
    bag.write_bytes(bag.read_bytes()[:200])
    with pytest.raises(SlambedError) as error:
        len(load_reader("bag")(bag, options(extra=BAG_TOPICS)))
    assert str(bag) in one_line(error)
