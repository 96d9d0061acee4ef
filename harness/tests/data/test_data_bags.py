# SPDX-License-Identifier: Apache-2.0
"""Bags with more than plain images: compressed depth, all kinds of ground truth, split parts."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from data_samples import CAMERA, HEIGHT, WIDTH, depth, gray, one_line
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from slambed.data.readers import ReaderOptions, load_reader
from slambed.data.trajectory import read_groundtruth, write_tum
from slambed.errors import SlambedError

STORE = get_typestore(Stores.ROS1_NOETIC)
START_NS = 50_000_000_000


def message(kind: str, **values: Any) -> Any:
    return STORE.types[kind](**values)


def header(ns: int) -> Any:
    stamp = message("builtin_interfaces/msg/Time", sec=ns // 10**9, nanosec=ns % 10**9)
    return message("std_msgs/msg/Header", seq=0, stamp=stamp, frame_id="c")


def image(ns: int, plane: np.ndarray[Any, Any], encoding: str, **changes: Any) -> Any:
    values = {
        "header": header(ns), "height": plane.shape[0], "width": plane.shape[1],
        "encoding": encoding, "is_bigendian": 0, "step": plane[0].nbytes,
        "data": np.ascontiguousarray(plane).view(np.uint8).reshape(-1),
    }  # fmt: skip
    return message("sensor_msgs/msg/Image", **(values | changes))


def compressed(ns: int, expected: str, data: bytes) -> Any:
    packed = np.frombuffer(data, np.uint8)
    return message(
        "sensor_msgs/msg/CompressedImage", header=header(ns), format=expected, data=packed
    )


def pose(x: float, w: float = 1.0) -> Any:
    position = message("geometry_msgs/msg/Point", x=x, y=0.0, z=1.0)
    turn = message("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=w)
    return message("geometry_msgs/msg/Pose", position=position, orientation=turn)


def stamped(i: int, x: float, w: float = 1.0) -> Any:
    ns = START_NS + i * 100_000_000
    return message("geometry_msgs/msg/PoseStamped", header=header(ns), pose=pose(x, w))


def write(path: Path, topics: dict[str, list[Any]], first: int = 0) -> Path:
    """Messages of a topic are 100 ms apart, like their headers; the first one is number `first`."""
    with Writer(path) as writer:
        for topic, messages in topics.items():
            kind = messages[0].__msgtype__
            connection = writer.add_connection(topic, kind, typestore=STORE)
            for i, one in enumerate(messages, first):
                writer.write(connection, START_NS + i * 10**8, STORE.serialize_ros1(one, kind))
    return path


def pictures(count: int = 3, first: int = 0) -> list[Any]:
    numbers = range(first, first + count)
    return [image(START_NS + i * 10**8, gray(i), "mono8") for i in numbers]


def reader(bag: Path, sensor: str = "mono", parts: tuple[Path, ...] = (), **extra: Any) -> Any:
    topics = {"first_topic": "/gray"} | ({} if sensor == "mono" else {"second_topic": "/second"})
    options = ReaderOptions(
        sensor=sensor,  # type: ignore[arg-type]
        size=(WIDTH, HEIGHT),
        camera=CAMERA,
        depth_unit_m=0.001,
        further_parts=parts,
        extra=topics | extra,
    )
    return load_reader("bag")(bag, options)


def png(plane: np.ndarray[Any, Any]) -> bytes:
    return bytes(cv2.imencode(".png", plane)[1].tobytes())


def with_depth(tmp_path: Path, expected: str, head: bytes, plane: np.ndarray[Any, Any]) -> Any:
    messages = [compressed(START_NS + i * 10**8, expected, head + png(plane)) for i in range(3)]
    return reader(write(tmp_path / "b.bag", {"/gray": pictures(), "/second": messages}), "rgbd")


def test_quantized_depth_is_decoded(tmp_path: Path) -> None:
    """As compressed_depth_image_transport writes it: inverse depth = A / depth + B."""
    a, b = 100.0 * 101.0, 1.0 - 100.0 * 101.0 / 10.0
    inverse = np.full((HEIGHT, WIDTH), round(a / 2.0 + b), np.uint16)
    inverse[0] = 0
    head = struct.pack("<iff", 0, a, b)
    frame = with_depth(tmp_path, "32FC1; compressedDepth png", head, inverse)
    second = next(iter(frame)).second
    assert second is not None and not second[0].any()
    assert second[1, 0] == pytest.approx(2000, abs=1)


def test_raw_depth_behind_its_header(tmp_path: Path) -> None:
    plane = depth(0, unit_m=0.001)
    found = with_depth(tmp_path, "16UC1; compressedDepth", bytes(12), plane)
    assert np.array_equal(next(iter(found)).second, plane)


@pytest.mark.parametrize(
    ("expected", "complaint"),
    [
        ("16UC1; compressedDepth rvl", "RVL compression is not supported"),
        ("compressedDepth", "does not say what the depth was"),
    ],
)
def test_depth_that_cannot_be_decoded_is_named(
    tmp_path: Path, expected: str, complaint: str
) -> None:
    with pytest.raises(SlambedError, match=complaint) as error:
        list(with_depth(tmp_path, expected, bytes(12), depth(0)))
    assert "b.bag /second" in one_line(error)


def test_meters_that_are_millimeters(tmp_path: Path) -> None:
    plane = np.full((HEIGHT, WIDTH), 2041.0, np.float32)
    messages = [image(START_NS, plane, "32FC1")]
    bag = write(tmp_path / "b.bag", {"/gray": pictures(1), "/second": messages})
    with pytest.raises(SlambedError, match=r"the largest value is 2041 .*millimeters?"):
        list(reader(bag, "rgbd"))


def test_depth_of_another_size(tmp_path: Path) -> None:
    messages = [image(START_NS, np.full((40, 80), 900, np.uint16), "16UC1")]
    bag = write(tmp_path / "b.bag", {"/gray": pictures(1), "/second": messages})
    with pytest.raises(SlambedError, match=r"depth of 80x40 .* has 64x48; align depth"):
        list(reader(bag, "rgbd"))


def test_sixteen_bits_of_gray_have_one_rule(tmp_path: Path) -> None:
    """Folders follow the same rule (test_data_judged)."""
    planes = [500 + 10 * gray(i).astype(np.uint16) for i in range(3)]
    raw = [image(START_NS + i * 10**8, planes[i], "mono16") for i in range(3)]
    packed = [
        compressed(START_NS + i * 10**8, "mono16; png compressed", png(planes[i])) for i in range(3)
    ]
    for name, messages in (("raw", raw), ("packed", packed)):
        bag = write(tmp_path / f"{name}.bag", {"/gray": messages})
        with pytest.raises(SlambedError, match="a picture of 16 bits with values 500 to 3050"):
            list(reader(bag))
        assert np.array_equal(list(reader(bag, gray_range=[500, 3050]))[1].gray, gray(1))


def test_a_step_shorter_than_a_row(tmp_path: Path) -> None:
    bag = write(tmp_path / "b.bag", {"/gray": [image(START_NS, gray(0), "mono8", step=10)]})
    with pytest.raises(SlambedError, match=r"need 64 bytes, the message says step 10"):
        list(reader(bag))


def test_header_stamps_that_are_zero(tmp_path: Path) -> None:
    bag = write(tmp_path / "b.bag", {"/gray": [image(0, gray(i), "mono8") for i in range(3)]})
    with pytest.raises(SlambedError, match="all header stamps are zero"):
        len(reader(bag))


def test_header_stamps_that_repeat_are_reported(tmp_path: Path) -> None:
    messages = [*pictures(), pictures()[2]]
    found = reader(write(tmp_path / "b.bag", {"/gray": messages}))
    assert len(found) == 3 and "1 images have the stamp of another one" in found.notes[0]


def odometry(i: int) -> Any:
    zeros = message("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    twist = message("geometry_msgs/msg/Twist", linear=zeros, angular=zeros)
    none = np.zeros(36)
    return message(
        "nav_msgs/msg/Odometry",
        header=header(START_NS + i * 10**8),
        child_frame_id="c",
        pose=message("geometry_msgs/msg/PoseWithCovariance", pose=pose(i), covariance=none),
        twist=message("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=none),
    )


def path_message(count: int) -> Any:
    poses = [stamped(i, float(i)) for i in range(count)]
    return message("nav_msgs/msg/Path", header=header(START_NS), poses=poses)


def point(i: int) -> Any:
    where = message("geometry_msgs/msg/Point", x=float(i), y=0.0, z=1.0)
    ns = START_NS + i * 10**8
    return message("geometry_msgs/msg/PointStamped", header=header(ns), point=where)


def truth_of(tmp_path: Path, messages: list[Any]) -> Any:
    bag = write(tmp_path / "b.bag", {"/gray": pictures(), "/truth": messages})
    return reader(bag, groundtruth_topic="/truth")


@pytest.mark.parametrize("kind", ["poses", "odometry", "path", "points"])
def test_ground_truth_of_every_kind(tmp_path: Path, kind: str) -> None:
    messages = {
        "poses": [stamped(i, float(i)) for i in range(3)],
        "odometry": [odometry(i) for i in range(3)],
        "path": [path_message(i) for i in (1, 2, 3)],
        "points": [point(i) for i in range(3)],
    }[kind]
    found = truth_of(tmp_path, messages)
    truth = found.trajectory()
    assert truth.stamps_s.tolist() == pytest.approx([50.0, 50.1, 50.2])
    assert truth.positions_m[:, 0].tolist() == [0, 1, 2]
    assert ("no orientation" in "".join(found.notes)) == (kind == "points")
    assert truth.has_orientation == (kind != "points")
    write_tum(tmp_path / "kept.txt", truth)
    kept = read_groundtruth(tmp_path / "kept.txt")
    assert kept.take(np.arange(2)).has_orientation == (kind != "points")


@pytest.mark.parametrize(
    ("messages", "complaint"),
    [
        ([stamped(0, 0.0), stamped(1, float("nan"))], r"/truth message 2: not finite: nan 0 1"),
        ([stamped(0, 0.0, w=0.0)], "not a rotation: the quaternion has length 0"),
        ([path_message(0)], "no pose in it"),
        (pictures(1), "sensor_msgs/msg/Image is no ground truth that is known"),
    ],
)
def test_bad_ground_truth_is_named(tmp_path: Path, messages: list[Any], complaint: str) -> None:
    with pytest.raises(SlambedError, match=complaint) as error:
        truth_of(tmp_path, messages).trajectory()
    one_line(error)


def test_parts_of_a_split_bag_are_one_recording(tmp_path: Path) -> None:
    parts = [
        write(tmp_path / f"w_{i}.bag", {"/gray": pictures(2, first=2 * i)}, 2 * i) for i in range(3)
    ]
    found = reader(parts[0], parts=tuple(parts[1:]))
    assert len(found) == 6 and list(found.files()) == parts
    assert all(np.array_equal(frame.gray, gray(i)) for i, frame in enumerate(found))


def test_a_bag_that_a_crash_cut_off(tmp_path: Path) -> None:
    bag = write(tmp_path / "b.bag", {"/gray": pictures()})
    bag.write_bytes(bag.read_bytes()[:-500])
    with pytest.raises(SlambedError, match="repair it with 'rosbag reindex'") as error:
        len(reader(bag))
    one_line(error)


def test_a_topic_without_pictures_is_named(tmp_path: Path) -> None:
    bag = write(tmp_path / "b.bag", {"/gray": [odometry(0)]})
    with pytest.raises(SlambedError, match=r"topic '/gray' has nav_msgs/msg/Odometry, expected"):
        len(reader(bag))


def test_what_lies_beside_a_bag_is_no_part_of_it(tmp_path: Path) -> None:
    bag = write(tmp_path / "b.bag", {"/gray": pictures()})
    found = reader(bag, parts=(tmp_path / "b.bag.txt", tmp_path / "old" / "b.bag"))
    assert len(found) == 3 and "matches 2 more that are no parts of it" in found.notes[0]


def test_images_of_one_stamp_do_not_pile_up(tmp_path: Path) -> None:
    twice = [item for item in pictures(5) for _ in range(2)]
    bag = reader(write(tmp_path / "b.bag", {"/gray": twice}))
    frames = iter(bag)
    next(frames)
    next(frames)
    waiting = frames.gi_frame.f_locals["waiting"]  # type: ignore[attr-defined]
    assert not waiting
    assert len(list(frames)) == 3
