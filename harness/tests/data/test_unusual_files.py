# SPDX-License-Identifier: Apache-2.0
"""Files that were read with another meaning, or refused with a line that helps nobody."""

from __future__ import annotations

import gzip
import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from command_line import refused, slambed
from data_samples import gray, write_tum
from test_data_bags import START_NS, image, message, reader, stamped, truth_of, write
from test_data_readers import options, write_euroc, write_kitti, write_seven_scenes

from slambed.data.camera_files import read_cameras
from slambed.data.catalog import Catalog
from slambed.data.images import read_gray
from slambed.data.import_camera import camera_yaml
from slambed.data.model import implausible
from slambed.data.path_file import read_path
from slambed.data.pose_columns import named_columns
from slambed.data.readers import load_reader
from slambed.data.readers.base import numbered
from slambed.data.recipe_file import load_recipe
from slambed.data.ros_images import depth_of
from slambed.data.trajectory import Trajectory, read_groundtruth, read_tum, repeated_times
from slambed.data.truth_times import fitting_truth
from slambed.errors import SlambedError
from slambed.files.yaml_source import load_yaml
from slambed.link.ping import read_ping
from slambed.link.traces import TraceFile, read_rate_trace, read_rtt_trace

ROW = "0.5 1 2 3 0.6 0 0 0.8\n"


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("time_s,px,py,pz,qw,qx,qy,qz", "0.5,1,2,3,0.8,0.6,0,0"),
        ("timestamp_ns,x,y,z,qw,qx,qy,qz", "5e8,1,2,3,0.8,0.6,0,0"),
        ("time (usec),x,y,z,qx,qy,qz,qw", "5e5,1,2,3,0.6,0,0,0.8"),
        ("# t x y z rw rx ry rz", "0.5 1 2 3 0.8 0.6 0 0"),
        ("#time_s qx qy qz qw tx ty tz", "0.5 0.6 0 0 0.8 1 2 3"),
        (
            "__time,/p/position/x,/p/position/y,/p/position/z,/p/orientation/w,/p/orientation/x,"
            "/p/orientation/y,/p/orientation/z",
            "0.5,1,2,3,0.8,0.6,0,0",
        ),
        (
            "header.stamp,position.x,position.y,position.z,orientation.w,orientation.x,"
            "orientation.y,orientation.z",
            "0.5,1,2,3,0.8,0.6,0,0",
        ),
        ("# [timestamp, tx, ty, tz, qw, qx, qy, qz]", "0.5 1 2 3 0.8 0.6 0 0"),
        ('"timestamp","tx","ty","tz","qw","qx","qy","qz"', "0.5,1,2,3,0.8,0.6,0,0"),
        ("# format: t x y z qw qx qy qz", "0.5 1 2 3 0.8 0.6 0 0"),
        ("# t | x [m] | y [m] | z [m] | qw | qx | qy | qz", "0.5 1 2 3 0.8 0.6 0 0"),
    ],
)
def test_names_and_units_of_a_header_count(tmp_path: Path, header: str, row: str) -> None:
    path = tmp_path / "a.txt"
    path.write_text(f"{header}\n{row}\n")
    assert read_tum(path).rows()[0].tolist() == pytest.approx([0.5, 1, 2, 3, 0.6, 0, 0, 0.8])


def test_a_header_with_an_unknown_name_is_refused(tmp_path: Path) -> None:
    """Which of q0 to q3 is the real part is a matter of taste."""
    path = tmp_path / "a.txt"
    path.write_text("t,x,y,z,q0,q1,q2,q3\n0.5,1,2,3,0.8,0.6,0,0\n")
    with pytest.raises(SlambedError, match="a header with q0, q1, q2, q3, which no pose has"):
        read_tum(path)


@pytest.mark.parametrize(
    ("header", "complaint"),
    [
        ("# t[s] tx[mm] ty[mm] tz[mm] qx qy qz qw", "tx in mm, expected meters"),
        ("#timestamp [ns], p_x [cm], p_y [cm], p_z [cm], qw, qx, qy, qz", "p_x in cm, expected"),
        ("# timestamp lat lon alt qx qy qz qw", "a header with lat, lon, alt, which no pose has"),
        ("# timestamp tx tx tz qx qy qz qw", "a header with a name twice"),
    ],
)
def test_a_header_that_is_of_no_pose_in_meters_is_refused(
    tmp_path: Path, header: str, complaint: str
) -> None:
    path = tmp_path / "a.txt"
    path.write_text(f"{header}\n{ROW}")
    with pytest.raises(SlambedError, match=complaint):
        read_tum(path)


def test_two_poses_of_one_time_are_told(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text(ROW + ROW + ROW.replace("1 2 3", "6 2 3") + ROW.replace("0.5", "0.6"))
    assert repeated_times(read_tum(path)) == 1
    assert "differ from another one of the same time: 1" in read_path(path).notes[0]
    path.write_text(ROW + ROW + ROW.replace("0.5", "0.6"))
    assert not read_path(path).notes


def test_a_ground_truth_beyond_the_earth_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text(ROW.replace("1 2 3", "1e300 2 3"))
    with pytest.raises(SlambedError, match="a pose is 1e\\+300 m away, expected meters"):
        read_groundtruth(path)
    assert len(read_tum(path)) == 1  # what a system left is an outcome


def test_poses_of_two_frames_on_one_topic_are_refused(tmp_path: Path) -> None:
    poses = [stamped(0, 0.0), stamped(1, 1.0)]
    moved = [message("geometry_msgs/msg/Transform", translation=p.pose.position,
                     rotation=p.pose.orientation) for p in poses]  # fmt: skip
    sent = [
        message("geometry_msgs/msg/TransformStamped", header=p.header, child_frame_id=name,
                transform=transform)
        for p, transform, name in zip(poses, moved, ("camera", "robot"), strict=True)
    ]  # fmt: skip
    with pytest.raises(SlambedError, match=r"message 2: poses of several frames \(camera, robot"):
        truth_of(tmp_path, sent).trajectory()


def test_times_of_euroc_belong_to_the_source(tmp_path: Path) -> None:
    """A list that changed is prepared anew."""
    write_euroc(tmp_path)
    found: Any = load_reader("euroc")(tmp_path, options(sensor="stereo"))
    lists = {file.parent.name for file in found.files() if file.name == "data.csv"}
    assert lists >= {"cam0", "cam1"}


def test_a_dataset_file_has_numbers_where_numbers_are_expected(tmp_path: Path) -> None:
    for key, value, complaint in (
        ("fps", "yes", "'fps': expected a number, not true or false"),
        ("fps", "1.0e-300", "greater than or equal to 0.001"),
        ("camera", "{width: 4, height: 4, fx: on, fy: 1, cx: 1, cy: 1, bf: 1}", "'camera.fx': exp"),
        ("camera", "{width: 4, height: 4, fx: 1, fy: 1, cx: 1, cy: 1, bf: 1, "
         "distortion: [no, 0, 0, 0]}", "'camera.distortion': expected a number"),
        ("download", "{url: 'file:///a', into: ../up}", "'download.into': '../up' is not below"),
        ("download", "{url: 'file:///a', into: ~/x}", "'download.into': '~/x' is not below"),
        ("download", "{url: 'file:///a', into: /x}", "'download.into': '/x' is not below the"),
    ):  # fmt: skip
        file = tmp_path / "x.yaml"
        file.write_text(f"id: x\ntitle: t\nreader: tum\npaths: [x]\n{key}: {value}\n")
        with pytest.raises(SlambedError, match=complaint):
            load_recipe(file)


def pictures_at(*stamps_ms: int) -> list[Any]:
    return [image(START_NS + ms * 10**6, np.zeros((48, 64), np.uint8), "mono8") for ms in stamps_ms]


def test_a_bag_whose_clock_was_set_back_is_refused(tmp_path: Path) -> None:
    """Sorted by stamp, pictures of before and after would be mixed."""
    bag = write(tmp_path / "a.bag", {"/gray": pictures_at(0, 100, 200, 300, 120, 220, 320)})
    with pytest.raises(SlambedError, match=r"/gray message 5: header stamps go back by 0\.18"):
        len(reader(bag))


def test_a_picture_that_overtook_another_is_sorted(tmp_path: Path) -> None:
    bag = write(tmp_path / "a.bag", {"/gray": pictures_at(0, 100, 300, 200, 400)})
    found = reader(bag)
    assert found.times_ns() == [START_NS + ms * 10**6 for ms in (0, 100, 200, 300, 400)]
    assert "1 images have an earlier stamp than the one before" in found.notes[0]


def test_one_topic_is_no_pair(tmp_path: Path) -> None:
    bag = write(tmp_path / "a.bag", {"/gray": pictures_at(0, 100)})
    with pytest.raises(SlambedError, match="first_topic and second_topic are both '/gray'"):
        reader(bag, "stereo", second_topic="/gray")


def test_poses_that_were_never_known_and_written_by_columns(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    write_seven_scenes(folder)
    files = sorted(folder.glob("*.pose.txt"))
    for file in files:
        np.savetxt(file, np.full((4, 4), -np.inf))
    found: Any = load_reader("seven_scenes")(folder, options())
    assert found.trajectory() is None and "3 of 3 frames are without a pose" in found.notes[0]
    pose = np.eye(4)
    pose[3, :3] = 0.1, 0.2, 0.3
    for file in files:
        np.savetxt(file, pose)
    with pytest.raises(SlambedError, match=r"last row of a pose is 0\.1 0\.2 0\.3 1, expected"):
        found.trajectory()


def test_images_go_by_the_number_behind_any_name(tmp_path: Path) -> None:
    for number in (0, 1, 10, 2):
        (tmp_path / f"img_{number}.png").touch()
    names = [file.stem for file in numbered(tmp_path, "", [".png"])]
    assert names == ["img_0", "img_1", "img_2", "img_10"]
    (tmp_path / "right_3.png").touch()
    with pytest.raises(SlambedError, match=r"images of several names, as img_.* and right_3"):
        numbered(tmp_path, "", [".png"])


def test_seconds_are_not_taken_for_milliseconds(tmp_path: Path) -> None:
    """As milliseconds, four of these poses would come at the time of a frame."""
    stamps_s = np.arange(100.0, 200.0, 0.01)
    zeros = np.zeros((len(stamps_s), 3))
    truth = Trajectory(stamps_s, zeros, np.tile([0, 0, 0, 1.0], (len(stamps_s), 1)))
    frames_ns = [round(1e9 * n / 30) for n in range(150)]
    with pytest.raises(SlambedError, match="does not overlap the frames"):
        fitting_truth(frames_ns, truth, "here")


def test_poses_before_the_clock_was_set_are_left_out() -> None:
    stamps_s = np.array([0.0, 0.0, 1.7e9, 1.7e9 + 0.1, 1.7e9 + 0.2])
    truth = Trajectory(stamps_s, np.zeros((5, 3)), np.tile([0, 0, 0, 1.0], (5, 1)))
    frames_ns = [round(1e9 * (1.7e9 + 0.1 * n)) for n in range(3)]
    found, notes = fitting_truth(frames_ns, truth, "here")
    assert len(found) == 3 and notes == ["here: 2 poses of the ground truth at time 0 are left out"]


def test_depth_that_does_not_fit_is_refused() -> None:
    depth = image(0, np.full((4, 4), 20.0, np.float32), "32FC1")
    with pytest.raises(SlambedError, match="up to 20 m does not fit into 65535 steps"):
        depth_of(depth, "here", 0.0002)
    assert depth_of(depth, "here", 0.001).max() == 20_000


OPENCV = """image_width: 640
image_height: 480
camera_matrix: {{rows: 3, cols: 3, data: [{matrix}]}}
distortion_coefficients: [0.1, 0.2, 0, 0]
"""
UPRIGHT = "500, 0, 320, 0, 500, 240, 0, 0, 1"


def test_calibrations_of_opencv(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(OPENCV.format(matrix="500, 0, 0, 0, 500, 0, 320, 240, 1"))
    assert "written by columns" in refused(2, "data", "import-camera", str(file))
    file.write_text(OPENCV.format(matrix=UPRIGHT) + "fisheye_model: 1\n")
    assert read_cameras(file)[1][0].lens.model == "equidistant"
    file.write_text(OPENCV.format(matrix=UPRIGHT.replace("500, 0,", "500, 7.5,", 1)))
    assert "a skew of 7.5" in refused(2, "data", "import-camera", str(file))
    file.write_text(OPENCV.format(matrix=UPRIGHT) + "roi: {x_offset: 100, y_offset: 50}\n")
    assert "are a region (roi)" in refused(2, "data", "import-camera", str(file))
    file.write_text(OPENCV.format(matrix=UPRIGHT) + "binning_x: 2\n")
    assert "binning_x is 2" in refused(2, "data", "import-camera", str(file))


def test_camera_info_of_both_ros(tmp_path: Path) -> None:
    """`rostopic echo` ends with a line of dashes; ROS 2 has small letters."""
    file = tmp_path / "a.yaml"
    for k, d, p, end in (("K", "D", "P", "---\n"), ("k", "d", "p", "")):
        file.write_text(
            f"width: 640\nheight: 480\n{k}: [{UPRIGHT}]\n{d}: [0.1, 0.2, 0, 0, 0]\n"
            f"{p}: [500, 0, 320, -60, 0, 500, 240, 0, 0, 0, 1, 0]\n{end}"
        )
        assert "bf: 60," in camera_yaml(file, 0, None)[0]


def test_numbers_that_no_camera_has() -> None:
    assert not implausible(320, 240, 0.1, (640, 480))
    assert not implausible(160, 120, 0.1, (64, 48))  # cut from a picture of 320x240
    assert "cx 3200 is far outside" in implausible(3200, 240, 0.1, (640, 480))
    assert "is it in mm?" in implausible(320, 240, 110.0, (640, 480))
    assert "left and right swapped" in implausible(320, 240, -0.1, (640, 480))
    assert implausible(320, 240, float("nan"), (640, 480))


def test_a_log_that_begins_and_ends_within_a_line() -> None:
    reply = "64 bytes from 1.1.1.1: icmp_seq={n} ttl=57 time={rtt}"
    lines = [reply.format(n=1, rtt="11.1 ms")]
    lines += [f"[{100 + 0.2 * n}] " + reply.format(n=n, rtt="11.1 ms") for n in (2, 3, 4)]
    lines.append("[101.0] " + reply.format(n=5, rtt="11"))
    log = read_ping(lines)
    assert log.is_stamped and len(log.echoes) == 3
    assert log.echoes[1].sent - log.echoes[0].sent == pytest.approx(0.2)


def test_a_rate_trace_counts_from_its_start(tmp_path: Path) -> None:
    trace = tmp_path / "a.up"
    trace.write_text("900000000\n900000001\n")
    with pytest.raises(SlambedError, match=r"the first packet is at 900000 s, .* line 1"):
        read_rate_trace(str(trace), None)


@pytest.mark.parametrize("number", ["040", "1:30", "-017", "1:30.5"])
def test_numbers_in_another_base_are_refused(tmp_path: Path, number: str) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(f"name: a\nrtt_ms: {number}\n")
    with pytest.raises(SlambedError, match=r"a leading 0 is octal.*line 2"):
        load_yaml(file)
    file.write_text("name: '040'\nrtt_ms: [0, 0.5, -0.25, 0x1F, 10]\n")
    assert load_yaml(file).data["rtt_ms"] == [0, 0.5, -0.25, 31, 10]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_yaml_in_other_encodings(tmp_path: Path, encoding: str) -> None:
    file = tmp_path / "a.yaml"
    file.write_bytes("title: Küche\n".encode(encoding))
    assert load_yaml(file).data == {"title": "Küche"}


def dataset_file(folder: Path, name: str, text: str) -> Path:
    folder.mkdir(exist_ok=True)
    file = folder / f"{name}.yaml"
    file.write_text(f"id: {name}\ntitle: {name}\n{text}")
    return file


def test_files_named_in_a_dataset_are_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    walk = "synthetic: {trajectory: office, seconds: 1}\n"
    for folder in ("own", "other"):
        dataset_file(tmp_path / folder, "whole", walk + f"note: {folder}\n")
    file = dataset_file(tmp_path / "own", "part", "window_of: ./whole.yaml\n")
    first = dataset_file(tmp_path / "own", "choice", "first_of: [./whole.yaml]\n")
    monkeypatch.chdir(tmp_path / "other")
    catalog = Catalog.load(tmp_path / "own", [])
    assert catalog.whole(catalog.get(str(file))).note == "own"
    assert catalog.resolve(str(first)).note == "own"


def test_a_first_of_that_leads_back_is_named(tmp_path: Path) -> None:
    one = dataset_file(tmp_path, "one", "first_of: [./two.yaml]\n")
    dataset_file(tmp_path, "two", "first_of: [./one.yaml]\n")
    line = refused(2, "data", "prepare", str(one))
    assert "'one': first_of leads back to it (one -> two -> one)" in line


def test_a_merged_mapping_may_be_overridden(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text("a: &base {x: 1, y: 2}\nb: {<<: *base, y: 3}\nc:\n  y: 4\n  <<: *base\n")
    assert load_yaml(file).data["b"] == {"x": 1, "y": 3}
    assert load_yaml(file).data["c"] == {"x": 1, "y": 4}
    file.write_text("a: &base {x: 1}\nb: {<<: *base, y: 3, y: 4}\n")
    with pytest.raises(SlambedError, match="key 'y' is given twice"):
        load_yaml(file)


def test_a_pipe_is_named(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "p")
    assert "pipe or device" in refused(2, "evaluate", str(tmp_path / "p"), str(tmp_path / "p"))
    with pytest.raises(SlambedError, match="a folder, pipe or device, expected a file"):
        read_tum(tmp_path / "p")


def test_times_of_kitti_increase(tmp_path: Path) -> None:
    poses, times = tmp_path / "poses.txt", tmp_path / "times.txt"
    poses.write_text("".join(f"1 0 0 {n} 0 1 0 0 0 0 1 {n * n}\n" for n in range(4)))
    times.write_text("0\n0.2\n0.1\n0.3\n")
    line = refused(2, "evaluate", str(poses), str(poses), "--times", str(times))
    assert f"{times}:3: 0.100000 is not later than 0.200000" in line
    times.write_text("0\n1\n2\n3\n")
    assert slambed("evaluate", str(poses), str(poses), "--times", str(times))[0] == 0


def test_poses_of_one_time_are_no_path(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text(5 * ROW)
    assert "all 5 poses have the time 0.500000 s" in refused(2, "evaluate", str(path), str(path))


def test_nanoseconds_and_commas_without_a_header_are_asked_about(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("1400000000000000000,1,2,3,1,0,0,0\n")
    with pytest.raises(SlambedError, match="is qw first, as EuRoC has it, or last"):
        read_tum(path)
    path.write_text("1400000000000000000 1 2 3 0 0 0 1\n")
    assert read_tum(path).quaternions_xyzw[0, 3] == 1
    path.write_text("#timestamp [ns], x, y, z, qw, qx, qy, qz\n14e17,1,2,3,1,0,0,0\n")
    assert read_tum(path).rows()[0].tolist() == [14e8, 1, 2, 3, 0, 0, 0, 1]


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("t, x [m], y [m], z [m], qw, qx, qy, qz", None),
        ("# format: t [ms] x y z qx qy qz qw", "ms"),
        ('"timestamp" [us],x [m],y,z,qx,qy,qz,qw', "us"),
        ("[timestamp_ns, tx, ty, tz, qx, qy, qz, qw]", "ns"),
    ],
)
def test_the_unit_of_time_is_that_of_its_own_column(header: str, unit: str | None) -> None:
    found = named_columns([header], "a.txt")
    assert found is not None and found.unit == unit


def test_names_of_images_may_have_a_hash(tmp_path: Path) -> None:
    write_tum(tmp_path)
    listing = tmp_path / "rgb.txt"
    first = listing.read_text().splitlines()[1].split()[1]
    (tmp_path / "a #1.png").write_bytes((tmp_path / first).read_bytes())
    listing.write_text(f"0.0 a #1.png\n0.1 {first} # the second\n")
    opened = load_reader("tum")(tmp_path, options(sensor="mono"))
    assert [file.name for file in opened.files()][1:] == ["a #1.png", Path(first).name]
    listing.write_text("# nothing below\n")
    with pytest.raises(SlambedError, match=r"rgb\.txt: no image in it; expected lines 'time file'"):
        load_reader("tum")(tmp_path, options(sensor="mono"))


def test_pictures_may_be_jpegs_and_hidden_files_are_none(tmp_path: Path) -> None:
    folder = write_kitti(tmp_path)
    for side in ("image_0", "image_1"):
        for file in sorted((folder / side).glob("*.png")):
            cv2.imwrite(str(file.with_suffix(".JPG")), read_gray(file))
            file.unlink()
    (folder / "image_0" / "._000000.png").write_bytes(b"\0")
    opened = load_reader("kitti")(folder, options(sensor="stereo"))
    assert [image.suffix for image in opened.files() if image.parent.name == "image_0"] == [
        ".JPG"
    ] * len(opened)
    (folder / "image_0" / "000000.png").write_bytes(b"\0")
    with pytest.raises(SlambedError, match=r"several formats \(\.jpg, \.png\)"):
        load_reader("kitti")(folder, options(sensor="stereo"))


def test_a_principal_point_outside_of_a_cut_picture_is_told(tmp_path: Path) -> None:
    calibration = write_kitti(tmp_path) / "calib.txt"
    for column, code in ((160, 0), (1600, 2)):
        matrix = f"100 0 {column} {{}} 0 100 24 0 0 0 1 0\n"
        calibration.write_text(f"P0: {matrix.format(0)}P1: {matrix.format(-50)}")
        file = dataset_file(
            tmp_path,
            "cut",
            f"reader: kitti\nsensor: stereo\npaths: ['{calibration.parent}']\nfps: 10\n",
        )
        found, _, told = slambed(
            "data", "prepare", str(file), SLAMBED_CACHE=str(tmp_path / "cache")
        )
        assert found == code, told
        assert ("note: " in told, "cx 160 is outside of a picture of 64x48" in told) == (
            (True, True) if code == 0 else (False, False)
        )


def test_color_of_scannet_may_be_jpeg(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    write_seven_scenes(folder)
    for file in sorted(folder.glob("*.color.png")):
        file.rename(file.with_suffix(".jpg"))
    opened = load_reader("seven_scenes")(folder, options(sensor="rgbd"))
    assert opened[0].second is not None and opened.trajectory() is not None


def test_what_is_wrong_with_a_calibration_of_kitti_is_named(tmp_path: Path) -> None:
    folder = write_kitti(tmp_path)
    calibration = folder / "calib.txt"
    p0, p1 = calibration.read_text().splitlines()[:2]

    def complaint(*lines: str) -> str:
        calibration.write_text("\n".join(lines))
        with pytest.raises(SlambedError) as error:
            load_reader("kitti")(folder, options(sensor="stereo")).camera()
        return str(error.value)

    assert ":3: P0 is given twice" in complaint(p0, p1, p0)
    skewed = p0.split()
    skewed[2] = "0.5"
    found = complaint(" ".join(skewed), p1)
    assert "P0 has the skew 0.5, expected 0" in found and "last row" not in found
    scaled = p0.split()
    scaled[-2] = "2"
    found = complaint(" ".join(scaled), p1)
    assert "the last row of P0 is 0 0 2 0, expected 0 0 1 0" in found and "skew" not in found


def test_a_folder_in_place_of_the_ground_truth_is_named(tmp_path: Path) -> None:
    write_tum(tmp_path)
    (tmp_path / "groundtruth.txt").unlink()
    (tmp_path / "groundtruth.txt").mkdir()
    opened = load_reader("tum")(tmp_path, options(sensor="mono", groundtruth="groundtruth.txt"))
    with pytest.raises(SlambedError, match=r"groundtruth\.txt is a folder \(ground truth\)"):
        list(opened.files())


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("paths: r", "'paths': expected a list, not 'r'"),
        ("paths: ['/']", "'paths': '/' names no file or folder below the data folders"),
        (
            "paths: [a]\nfps: 29,97",
            "expected a number, not the text '29,97' .write a decimal point",
        ),
        ("paths: [a]\nreader_options: {x: 1}\nreader_options: {x: 1}", "is given twice"),
        ("paths: [a]\nnote: 'a\x07'", "special characters are not allowed: 0x7, .* line 5"),
        ("paths: [a]\n---\nid: b", "a second document begins with '---', expected one"),
    ],
)
def test_mistakes_of_a_dataset_file_are_named(tmp_path: Path, text: str, complaint: str) -> None:
    file = dataset_file(tmp_path, "own", f"reader: kitti\n{text}\n")
    with pytest.raises(SlambedError, match=complaint):
        load_recipe(file)


def test_a_packed_bag_is_named(tmp_path: Path) -> None:
    bag = tmp_path / "a.bag"
    bag.write_bytes(gzip.compress(b"#ROSBAG V2.0"))
    with pytest.raises(SlambedError, match=r"a\.bag: packed by gzip; unpack it"):
        list(reader(bag))


def test_a_smaller_picture_of_a_bag_is_named(tmp_path: Path) -> None:
    small = np.zeros((8, 8), np.uint8)
    images = [image(START_NS, gray(0), "mono8"), image(START_NS + 10**8, small, "mono8")]
    opened = reader(write(tmp_path / "a.bag", {"/gray": images}))
    with pytest.raises(SlambedError, match=r"50\.100000 s of .* /gray: a picture of 8x8 pixels"):
        list(opened)


def test_limits_of_evaluate_are_checked(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("".join(f"{n} {n} 0 {n * n} 0 0 0 1\n" for n in range(5)))
    both = ("evaluate", str(path), str(path))
    assert "expected a time above 0 s" in refused(2, *both, "--delta-s", "0")
    assert "greater than or equal to 0" in refused(2, *both, "--max-difference-s", "-1")


def test_a_commented_header_of_a_trace_counts(tmp_path: Path) -> None:
    trace = tmp_path / "a.csv"
    trace.write_text("# from a phone\n# rtt_ms,time_s\n10,0\n20,0.5\n")
    found = read_rtt_trace(TraceFile(file=str(trace)), None).curve
    assert found.times_s.tolist() == [0, 0.5] and found.values_ms.tolist() == [10, 20]
    trace.write_text("# time_s,rtt_ms\nrtt_ms,time_s\n10,0\n20,0.5\n")
    again = read_rtt_trace(TraceFile(file=str(trace)), None).curve
    assert again.values_ms.tolist() == [10, 20]
