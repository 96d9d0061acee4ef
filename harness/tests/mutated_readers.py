# SPDX-License-Identifier: Apache-2.0
"""Every reader of files that a user names, with a small valid input: what mutants are made of.

`read` does with the input what a command does, and returns what it means: equal texts, equal
meanings. What it accepts must be sound; `UnsoundError` names what is not.
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import re
import sqlite3
import tarfile
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import cv2
import numpy as np
from harness_parts import DEVICE, EXPERIMENT, SYSTEMS, specs
from mutator import Content, Files, Folder, Mutator, write
from numpy.typing import NDArray
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from test_import_camera import CAMODOCAL, KALIBR, OPENCV, ORBSLAM, ORBSLAM3, PROJECTION, ROS
from test_pack import experiment as results_of

from slambed.campaign.pack import pack, unpack
from slambed.campaign.plan import check
from slambed.campaign.status import status_of
from slambed.commands.report import evaluate
from slambed.data.catalog import Catalog
from slambed.data.import_camera import camera_yaml
from slambed.data.prepared import SEQUENCE_FILE, PreparedSequence
from slambed.data.recipe import CameraRecipe
from slambed.data.trajectory import Trajectory, read_groundtruth, read_tum
from slambed.files.yaml_text import read_yaml
from slambed.link.modeled import modeled_link
from slambed.link.netem import why_not_netem
from slambed.link.profile import Profile, load_profile, parse_profile
from slambed.spec.device import LOCAL, VIRTUAL
from slambed.spec.library import Library
from slambed.spec.run_spec import canonical_json
from slambed.spec.runtime import foreign_digest

WIDTH, HEIGHT, FRAMES = 16, 12, 4
START_NS = 1_305_031_102_100_000_000
STEP_NS = 100_000_000
CAMERA = f"{{width: {WIDTH}, height: {HEIGHT}, fx: 12, fy: 12, cx: 8, cy: 6, bf: 4}}"


class UnsoundError(AssertionError):
    """Accepted, and not what anybody can work with."""


@dataclass(frozen=True)
class Subject:
    """A reader with its valid input."""

    name: str
    files: Callable[[], Files]
    read: Callable[[Path, Path], str]
    """Input folder, empty folder for output -> what it means."""
    whole: tuple[str, ...] = ()
    """Beginnings of files that stay as they are."""
    variant: Callable[[Mutator], Files] | None = None
    """Valid containers of invalid content, where bytes alone seldom make any."""

    def mutant(self, seed: int) -> tuple[Files, list[str]]:
        """The files of a mutant, and what was done to them."""
        mutator = Mutator.of(self.name, seed)
        files = self.files()
        if self.variant is not None and mutator.random.random() < 0.6:
            files = self.variant(mutator)
            if mutator.random.random() < 0.8:
                return files, mutator.steps
        kept = {name: files[name] for name in files if name.startswith(self.whole or ("\0",))}
        changed = mutator.mutated({n: c for n, c in files.items() if n not in kept})
        return kept | changed, mutator.steps


def must(holds: bool, what: str) -> None:
    if not holds:
        raise UnsoundError(what)


# Recordings.


def gray(i: int) -> NDArray[np.uint8]:
    return np.random.default_rng(i).integers(0, 256, (HEIGHT, WIDTH), dtype=np.uint8)


def depth(i: int) -> NDArray[np.uint16]:
    plane = np.full((HEIGHT, WIDTH), 2000 + i, np.uint16)
    plane[0] = 0
    return plane


def png(plane: NDArray[Any]) -> bytes:
    return bytes(cv2.imencode(".png", plane)[1].tobytes())


def jpeg(plane: NDArray[Any]) -> bytes:
    return bytes(cv2.imencode(".jpg", plane)[1].tobytes())


def recipe(**changes: str) -> Content:
    keys = {
        "id": "tiny", "title": "Tiny", "paths": "[walk]", "fps": "10", "camera": CAMERA,
    } | changes  # fmt: skip
    return "".join(f"{key}: {value}\n" for key, value in keys.items() if value).encode()


def seconds(i: int) -> str:
    return f"{(START_NS + i * STEP_NS) * 1e-9:.6f}"


def tum_poses(start_s: float = START_NS * 1e-9, count: int = FRAMES) -> bytes:
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    for i in range(count):
        lines.append(f"{start_s + 0.1 * i:.4f} {0.1 * i:.3f} {0.02 * i * i:.3f} 1.0 0 0 0 1")
    return "\n".join(lines).encode() + b"\n"


@cache
def _tum() -> Files:
    color, far = ["# color images"], ["# depth images"]
    files: Files = {}
    for i in range(FRAMES):
        files[f"data/walk/rgb/{seconds(i)}.png"] = png(gray(i))
        files[f"data/walk/depth/{seconds(i)}.png"] = png(depth(i))
        color.append(f"{seconds(i)} rgb/{seconds(i)}.png")
        far.append(f"{seconds(i)} depth/{seconds(i)}.png")
    files["data/walk/rgb.txt"] = ("\n".join(color) + "\n").encode()
    files["data/walk/depth.txt"] = ("\n".join(far) + "\n").encode()
    files["data/walk/groundtruth.txt"] = tum_poses()
    files["datasets/tiny.yaml"] = recipe(
        reader="tum", depth_unit_m="0.001", groundtruth="groundtruth.txt"
    )
    return files


@cache
def _seven_scenes() -> Files:
    files: Files = {"datasets/tiny.yaml": recipe(reader="seven_scenes", depth_unit_m="0.001")}
    for i in range(FRAMES):
        stem = f"data/walk/frame-{i:06}"
        files[f"{stem}.color.png"], files[f"{stem}.depth.png"] = png(gray(i)), png(depth(i))
        rows = np.eye(4)
        rows[0, 3] = 0.1 * i
        text = "\n".join(" ".join(f"{v:.7e}" for v in row) for row in rows)
        files[f"{stem}.pose.txt"] = text.encode()
    return files


@cache
def _kitti() -> Files:
    head = "12 0 8 0 0 12 6 0 0 0 1 0"
    poses = [f"1 0 0 {0.1 * i:.2f} 0 1 0 0 0 0 1 {i}" for i in range(FRAMES)]
    files: Files = {
        "datasets/tiny.yaml": recipe(
            reader="kitti", sensor="stereo", camera="", groundtruth="07.txt",
            paths="[sequences/07]",
        ),
        "data/sequences/07/calib.txt": f"P0: {head}\nP1: {head.replace('8 0', '8 -6')}\n".encode(),
        "data/sequences/07/times.txt": "".join(f"{0.1 * i:e}\n" for i in range(FRAMES)).encode(),
        "data/poses/07.txt": ("\n".join(poses) + "\n").encode(),
    }  # fmt: skip
    for side in (0, 1):
        for i in range(FRAMES):
            files[f"data/sequences/07/image_{side}/{i:06}.png"] = png(gray(10 * side + i))
    return files


SENSOR = """sensor_type: camera
rate_hz: 10
resolution: [16, 12]
camera_model: pinhole
intrinsics: [12.0, 12.0, 8.0, 6.0]
distortion_model: radial-tangential
distortion_coefficients: [-0.02, 0.01, 0.0001, 0.0001]
T_BS:
  cols: 4
  rows: 4
  data: [1.0, 0.0, 0.0, {x}, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
"""


@cache
def _euroc() -> Files:
    stamps = [START_NS + i * STEP_NS for i in range(FRAMES)]
    files: Files = {"datasets/tiny.yaml": recipe(reader="euroc", sensor="stereo", camera="")}
    for side in (0, 1):
        folder = f"data/walk/mav0/cam{side}"
        files[f"{folder}/sensor.yaml"] = SENSOR.format(x=0.1 * side).encode()
        rows = ["#timestamp [ns],filename", *(f"{stamp},{stamp}.png" for stamp in stamps)]
        files[f"{folder}/data.csv"] = ("\n".join(rows) + "\n").encode()
        for i, stamp in enumerate(stamps):
            files[f"{folder}/data/{stamp}.png"] = png(gray(10 * side + i))
    rows = ["#timestamp, p_x, p_y, p_z, q_w, q_x, q_y, q_z, v_x, v_y, v_z"]
    rows += [f"{stamp},{0.1 * i:.2f},0,1,1,0,0,0,1,0,0" for i, stamp in enumerate(stamps)]
    truth = "data/walk/mav0/state_groundtruth_estimate0/data.csv"
    files[truth] = ("\n".join(rows) + "\n").encode()
    return files


def prepared(source: Path, work: Path) -> str:
    """What `slambed data prepare` and `verify` do."""
    catalog = Catalog.load(source / "datasets", [source / "data"])
    return sound(catalog.prepare("tiny", work / "cache"))


def sound(sequence: PreparedSequence) -> str:
    sequence.verify()
    info, times = sequence.info, sequence.times_s
    must(len(sequence) > 1 and bool((np.diff(times) > 0).all()), "times do not increase")
    must(bool(np.isfinite(times).all()), "times are not finite")
    numbers = [*info.camera.model_dump(exclude={"distortion"}).values(), *info.camera.distortion]
    must(all(map(math.isfinite, [*numbers, info.fps, info.time_origin_s])), "a camera of NaN")
    must(sequence[0].gray.shape == (info.height, info.width), "pictures of another size")
    json.loads((sequence.path / SEQUENCE_FILE).read_text(), parse_constant=_no_number)
    if (truth := sequence.groundtruth()) is not None:
        sound_path(truth)
        must(bool((np.diff(truth.stamps_s) > 0).all()), "times of poses do not increase")
        lengths = np.linalg.norm(truth.quaternions_xyzw, axis=1)
        must(bool((np.abs(lengths - 1) < 1e-6).all()), "a pose that is no rotation")
    truth_bytes = sequence.groundtruth_file.read_bytes() if sequence.groundtruth_file else b""
    return f"{sequence.checksum} {truth_bytes!r}"


def sound_path(path: Trajectory) -> None:
    must(bool(np.isfinite(path.rows()).all()), "a pose that is not finite")


def _no_number(word: str) -> None:
    raise UnsoundError(f"{word} in JSON")


# Bags.

STORES = {
    "bag": get_typestore(Stores.ROS1_NOETIC),
    "bag_ros2": get_typestore(Stores.ROS2_HUMBLE),
    "mcap": get_typestore(Stores.ROS2_HUMBLE),
}
BAG_RECIPE = {
    "reader": "bag", "depth_unit_m": "0.001",
    "reader_options": "{first_topic: /gray, second_topic: /depth, groundtruth_topic: /pose}",
}  # fmt: skip
FIELDS = ("height", "width", "encoding", "is_bigendian", "step", "data", "sec", "nanosec")
ENCODINGS = (
    "mono8", "8UC1", "rgb8", "bgr8", "bgra8", "mono16", "16UC1", "32FC1", "8UC4", "64FC1", "",
    "bayer_rggb8", "yuv422", "\u00e4", "rgb8; jpeg compressed", "16UC1; compressedDepth",
    "32FC1; compressedDepth png", "16UC1; compressedDepth rvl", "a\nb", "x" * 500,
)  # fmt: skip


@dataclass
class Said:
    """A message: topic, when the bag got it, what its header and its other fields say."""

    topic: str
    received_ns: int
    stamp_ns: int
    values: dict[str, Any]
    packed: bool = False


def _said() -> list[Said]:
    found = []
    for i in range(FRAMES):
        ns = START_NS + i * STEP_NS
        for topic, plane in (("/gray", gray(i)), ("/depth", depth(i))):
            values = {
                "height": HEIGHT, "width": WIDTH, "is_bigendian": 0, "step": plane[0].nbytes,
                "encoding": "mono8" if topic == "/gray" else "16UC1", "data": plane.tobytes(),
            }  # fmt: skip
            found.append(Said(topic, ns, ns, values))
        found.append(Said("/pose", ns, ns, {"pose": [0.1 * i, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]}))
    return found


def _message(store: Any, said: Said) -> Any:
    def make(kind: str, **values: Any) -> Any:
        return store.types[kind](**values)

    stamp = make(
        "builtin_interfaces/msg/Time",
        sec=said.stamp_ns // 10**9,
        nanosec=said.values.get("nanosec", said.stamp_ns % 10**9),
    )
    seq = {"seq": 0} if "seq" in store.types["std_msgs/msg/Header"].__annotations__ else {}
    header = make("std_msgs/msg/Header", stamp=stamp, frame_id="c", **seq)
    if "pose" in said.values:
        x, y, z, *turn = said.values["pose"]
        names = ("x", "y", "z", "w")
        pose = make(
            "geometry_msgs/msg/Pose",
            position=make("geometry_msgs/msg/Point", x=x, y=y, z=z),
            orientation=make(
                "geometry_msgs/msg/Quaternion", **dict(zip(names, turn, strict=False))
            ),
        )
        return make("geometry_msgs/msg/PoseStamped", header=header, pose=pose)
    values = {k: v for k, v in said.values.items() if k != "nanosec"}
    values["data"] = np.frombuffer(values["data"], np.uint8)
    if said.packed:
        return make(
            "sensor_msgs/msg/CompressedImage",
            header=header,
            format=values["encoding"],
            data=values["data"],
        )
    return make("sensor_msgs/msg/Image", header=header, **values)


@cache
def _definition(kind: str, message: str) -> dict[str, str]:
    """What a bag says of a type of messages."""
    text, digest = STORES[kind].generate_msgdef(message, ros_version=1 if kind == "bag" else 2)
    if kind == "bag":
        return {"msgdef": text, "md5sum": digest}
    return {"msgdef": text, "rihs01": STORES[kind].hash_rihs01(message)}


def _written(kind: str, messages: list[Said]) -> Files:
    store = STORES[kind]
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "walk"
        if kind == "bag":
            path = path.with_suffix(".bag")
            writer: Any = Writer1(path)
        else:
            plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
            writer = Writer2(path, version=9, storage_plugin=plugin)
        with writer as bag:
            connections: dict[tuple[str, str], Any] = {}
            for said in messages:
                message = _message(store, said)
                key = (said.topic, message.__msgtype__)
                if key not in connections:
                    connections[key] = bag.add_connection(*key, **_definition(kind, key[1]))
                serialize = store.serialize_ros1 if kind == "bag" else store.serialize_cdr
                raw = serialize(message, message.__msgtype__)
                bag.write(connections[key], said.received_ns, raw)
        if kind == "bag":
            return {"data/walk.bag": path.read_bytes()}
        if kind == "mcap":
            return {"data/walk.mcap": next(path.glob("*.mcap")).read_bytes()}
        if kind == "bag_ros2":
            for database in path.glob("*.db3"):
                # Its own `with` would leave it open.
                with contextlib.closing(sqlite3.connect(database)) as connection:
                    connection.execute("PRAGMA journal_mode=DELETE")
        return {f"data/walk/{file.name}": file.read_bytes() for file in sorted(path.iterdir())}


@cache
def _bag(kind: str) -> Files:
    return {**_dataset_file(), **_written(kind, _said())}


def _dataset_file() -> Files:
    return {"datasets/tiny.yaml": recipe(**BAG_RECIPE, paths="['walk*']")}


def _odd_messages(kind: str) -> Callable[[Mutator], Files]:
    """Bags that are whole, of messages that are not."""

    def variant(mutator: Mutator) -> Files:
        r = mutator.random
        messages = _said()
        for _ in range(r.choice((1, 1, 2, 3))):
            chosen = [r.choice(messages)]
            if r.random() < 0.5:
                chosen = [said for said in messages if said.topic == chosen[0].topic]
            way = r.choice(("header", "field", "field", "field", "pose", "order", "packed"))
            mutator.steps.append(f"{chosen[0].topic}: {way}")
            _odd(r, way, chosen, messages)
        try:
            return {
                "datasets/tiny.yaml": _bag(kind)["datasets/tiny.yaml"],
                **_written(kind, messages),
            }
        except Exception:  # no bag can hold it
            mutator.steps.append("no bag holds it")
            return _bag(kind)

    return variant


def _odd(r: Random, way: str, chosen: list[Said], messages: list[Said]) -> None:
    match way:
        case "header":
            shift = r.choice((-(10**18), 10**18, 10**9, 10**7, 0, -START_NS, 10**19))
            same = r.random() < 0.3
            nanoseconds = r.choice((None, None, 0, 2**31 - 1, 10**9))
            for said in chosen:
                said.stamp_ns = shift % 2**62 if same else said.stamp_ns + shift
                if nanoseconds is not None:
                    said.values["nanosec"] = nanoseconds
        case "field":
            field = r.choice(FIELDS[:6])
            number = r.choice((0, 1, 2, 7, 24, 32, 2**16, 2**31 - 1, 2**32 - 1))
            encoding, cut = r.choice(ENCODINGS), r.choice((0, 1, 30, 10_000))
            for said in (s for s in chosen if field in s.values):
                if field == "encoding":
                    said.values[field] = encoding
                elif field == "data":
                    said.values[field] = (said.values[field] * 4)[:cut]
                else:
                    said.values[field] = number
        case "pose":
            value = r.choice((math.nan, math.inf, 1e300, 1e308, 0.0, 2.0, -1.0))
            place = r.randrange(7)
            for said in (s for s in chosen if "pose" in s.values):
                said.values["pose"][place] = value
        case "order":
            if r.random() < 0.5:
                r.shuffle(messages)
            else:
                for said in chosen:
                    messages.remove(said)
        case "packed":
            encoding, raw = r.choice(ENCODINGS), r.random() < 0.3
            head = r.choice((b"", bytes(12), b"\0\0\0\0\0\0\x80?\0\0\x80?", b"abc"))
            lie = Mutator(r, ["picture"])
            for i, said in enumerate(s for s in chosen if "data" in s.values):
                plane = gray(i) if said.topic == "/gray" else depth(i)
                data = png(plane) if said.topic == "/depth" or r.random() < 0.5 else jpeg(plane)
                if r.random() < 0.6:
                    data = r.choice((lie._png, lie._bytes, lie._numbers))(data)
                said.packed, said.values["encoding"] = True, encoding
                said.values["data"] = data if raw else head + data


# Trajectories and calibrations.


@cache
def _trajectories() -> Files:
    return {"estimate.txt": tum_poses(1000.0, 30), "truth.txt": tum_poses(1000.004, 30)}


def _evaluated(source: Path, work: Path) -> str:
    """What `slambed evaluate` does, and what reads ground truth."""
    own, true = source / "estimate.txt", source / "truth.txt"
    for path in (read_tum(own), read_groundtruth(true)):
        sound_path(path)
    return _errors_of(own, true)


def _errors_of(own: Path, true: Path, times: Path | None = None) -> str:
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        evaluate(own, true, times=times)
    must(not re.search(r"\b(nan|inf)\b", printed.getvalue()), printed.getvalue())
    return printed.getvalue()


@cache
def _kitti_poses() -> Files:
    """Two drives of 30 frames along a curve, and times of the frames."""
    files: Files = {"times.txt": "".join(f"{0.1 * i:e}\n" for i in range(30)).encode()}
    for name, scale in (("estimate", 1.01), ("truth", 1.0)):
        rows = []
        for i in range(30):
            c, s = np.cos(0.1 * i), np.sin(0.1 * i)
            turn = [c, 0, s, 10 * scale * s, 0, 1, 0, 0.1 * scale * i, -s, 0, c, 10 * scale * c]
            rows.append(" ".join(f"{value:e}" for value in turn))
        files[f"{name}.txt"] = ("\n".join(rows) + "\n").encode()
    return files


def _evaluated_by_line(source: Path, work: Path) -> str:
    """KITTI's poses, without and with times."""
    own, true = source / "estimate.txt", source / "truth.txt"
    return _errors_of(own, true) + _errors_of(own, true, source / "times.txt")


@cache
def _calibrations() -> Files:
    texts = {"asl": SENSOR.format(x=0.1), "kalibr": KALIBR, "opencv": OPENCV, "ros": ROS}
    texts["orbslam"] = ORBSLAM
    texts |= {"orbslam3": ORBSLAM3, "camodocal": CAMODOCAL}
    texts["ros_right"] = ROS + PROJECTION.format(k=500, t=-60)
    return {f"{name}.yaml": text.encode() for name, text in texts.items()}


def _cameras(source: Path, work: Path) -> str:
    """What `slambed data import-camera` prints is a camera that a dataset file takes. The first
    file that is refused refuses them all."""
    found = []
    for name in _calibrations():
        text, _ = camera_yaml(source / name, 0, None)
        camera = CameraRecipe(**read_yaml(text)["camera"])
        numbers = [camera.fx, camera.fy, camera.cx, camera.cy, camera.bf, *camera.distortion]
        must(all(map(math.isfinite, numbers)), f"{name}: a camera of NaN")
        found.append(camera.model_dump_json())
    return "\n".join(found)


# Links.

PROFILES = {
    "columns": "rtt_ms: {trace: {file: a.csv, time: t, rtt: rtt}}\nduration_s: 3\n",
    "ping": "rtt_ms: {trace: {file: a.log, format: ping}}\n",
    "windows": "rtt_ms: {trace: {file: b.log, format: ping}}\n",
    "mahimahi": "rtt_ms: 20\nrate: {trace: a.trace}\nup: {rate: {trace: b.trace}}\n",
    "made": """name: made
description: all there is
source: us
params: {peak_ms: 40}
one_way_ms:
  up: {sum: [5, {ramp: {to_ms: $peak_ms, start_s: 1, rise_s: 2, hold_s: 1, fall_s: 2}}]}
  down:
    clamp:
      min_ms: 1
      of: {scale: {factor: 0.5, of: {repeat: {period_s: 4, of: {points: [[0, 5], [3, 30]]}}}}}
jitter: {sd_ms: 2, correlation: 0.2}
loss: {gilbert_elliott: {good_s: 2, bad_s: 0.1}}
rate: {mbps: 20, queue_bytes: 60000}
up: {loss: {random: 0.01}, jitter: {shape: pareto, mean_ms: 1, max_ms: 20}}
gaps: [{start_s: 2, length_s: 0.5, every_s: 10}]
gap_mode: drop
""",
    "waves": """rtt_ms:
  delayed: {by_s: 1, of: {sine: {mean_ms: 40, amplitude_ms: 30, period_s: 5}}}
up_share: 0.4
loss: {gilbert_elliott: {to_bad: 0.01, to_good: 0.3, loss_bad: 0.8}}
jitter: {sd_ms: 1, correlation_s: 0.1}
duration_s: 20
""",
    "jumps": "rtt_ms: {steps: [[0, 10], [2, 60], [4.5, 10]]}\nrate: {mbps: 1.5}\n",
}


def _profile_files(*names: str) -> Files:
    return {f"{name}.yaml": PROFILES[name].encode() for name in names}


@cache
def _columns() -> Files:
    rows = ["t,rtt,note", *(f"{0.1 * i:.1f},{20 + i % 7},x" for i in range(30))]
    text = "# made here\n" + "\n".join(rows) + "\n"
    return {**_profile_files("columns"), "a.csv": text.encode()}


@cache
def _ping() -> Files:
    head = "PING 192.0.2.1 (192.0.2.1) 56(84) bytes of data.\n"
    line = "[{at:.6f}] 64 bytes from 192.0.2.1: icmp_seq={i} ttl=57 time={ms:.1f} ms\n"
    unix = head + "".join(line.format(at=1.3e9 + i, i=i, ms=11.3 + i) for i in range(1, 12))
    other = "Reply from 192.0.2.1: bytes=32 time={ms}ms TTL=57\n"
    windows = "\n" + "".join(other.format(ms=12 + i) for i in range(8))
    return {**_profile_files("ping", "windows"), "a.log": unix.encode(), "b.log": windows.encode()}


@cache
def _mahimahi() -> Files:
    def rate(step: int) -> bytes:
        return "".join(f"{step * i // 2}\n" for i in range(1, 40)).encode()

    return {**_profile_files("mahimahi"), "a.trace": rate(3), "b.trace": rate(7)}


@cache
def _made_profiles() -> Files:
    return _profile_files("made", "waves", "jumps")


def _linked(*names: str) -> Callable[[Path, Path], str]:
    def read(source: Path, work: Path) -> str:
        return "\n".join(_link(load_profile(source / f"{name}.yaml")) for name in names)

    return read


def _link(profile: Profile) -> str:
    """What a run's link is configured with; `why_not_netem` is asked for every run."""
    link = modeled_link(profile, 20.0)
    for side in (link.up, link.down):
        must(bool(side.delay_us) and min(side.delay_us) >= 0, "a negative delay")
        must(all(map(math.isfinite, side.delay_us)), "a delay that is not finite")
    why_not_netem(profile)
    text = json.dumps(link.as_json(), allow_nan=False)
    numbers = [abs(float(number)) for number in re.findall(r"-?\d[\d.e+-]*", text)]
    must(max(numbers) < 2**53, f"a number of {max(numbers):g} for the relay")
    canonical_json(dict(profile.content))
    if not profile.rate_traces and "trace" not in json.dumps(dict(profile.content)):
        again = parse_profile(profile.content, "experiment.json")
        must(modeled_link(again, 20.0) == link, "another link when read from experiment.json")
    return text


# Files of a checkout.

SHARED = """n_orb: {type: int, default: 1000, min: 100, max: 4000, unit: features}
speed: {type: float, default: 0.5, min: 0, max: 1, doc: how fast}
"""
SYSTEM = """name: mine
title: A system of somebody's own
roles: [mobile, edge]
channels: [control, keyframe]
sensors: [rgbd, mono]
params_from: ../shared.yaml
params:
  speed: {default: 0.25}
  update: {type: str, default: serial, choices: [serial, parallel]}
  prior_map: {type: path, default: '', role: edge}
variants:
  plain: {}
  better: {title: better, params: {n_orb: 750, update: parallel}}
metrics:
  shed: {doc: how often, event: shed, take: count, label: shed, better: lower}
  wait_ms: {doc: how long, event: wait, take: median, field: ms, where: {state: ok}}
runtime:
  files: [program.sh]
  ready_s: 10
  mobile: {command: ['{folder}/program.sh', --fast], env: {A: b}, gpu: 1}
  edge: {command: [./program.sh], client: false, tmpfs: {/tmp: 10}}
"""
DEVICE_FILE = """name: small
title: A small computer
hardware: none
limits: {cores: 2, memory_mb: 512, period_ms: 10}
board: {cores: 4, core_speed: 0.4}
model:
  cores: 4
  speed: 0.8
  background: 0.1
  accelerators: {gpu: {lanes: 2, speed: 2.0}}
  stages:
    extract: {a_us: 100, b_us: 2.5, jitter: 0.1, accelerator: gpu}
    pose: {a_us: 50, c_us: 0.01}
notes: made here
"""
EXPERIMENT_FILE = """id: tiny
title: A tiny experiment
reproduces: [nothing]
systems:
  - {system: solo, label: 'alone {n_orb}', grid: {params.n_orb: [500, 1000]}}
  - system: pair
    variant: better
    params: {period_s: 1}
    profiles: [none, mild]
    devices: {edge: small}
    faults: [{at_s: 0.5, edge: kill}, {at_s: 1, edge: restart}, {at_s: 1.2, link: cut, for_s: 0.1}]
datasets: [synthetic_room]
missing_datasets: skip
playback: {mode: realtime, fps: 10, start_s: 0, end_s: 2}
link:
  backend: relay
  profiles: [none, 40, {profile: ramp_85, name: mild}, {name: own, rtt_ms: 5, jitter: {sd_ms: 1}}]
devices: {mobile: small, edge: big}
runs: {default: 2, paper: 100}
tolerances: {rtt_error_ms_median: 2, cpu_wait_share_max: 0.5}
report: {metrics: [ate_rmse_m], plots: [paths]}
seed: 7
"""


def _checkout() -> Files:
    files: Files = {f"systems/{n}/system.yaml": text.encode() for n, text in SYSTEMS.items()}
    for name, quota in (("small", 0.5), ("big", 1.0)):
        text = DEVICE.format(name=name, quota=quota) + "model: {cores: 1, stages: {}}\n"
        files[f"catalog/devices/{name}.yaml"] = text.encode()
    return files


@cache
def _experiment_files() -> Files:
    return {
        **_checkout(),
        "experiments/tiny.yaml": EXPERIMENT_FILE.encode(),
        "experiments/other.yaml": EXPERIMENT.replace("room", "synthetic_room")
        .replace("id: tiny", "id: other")
        .replace("ramp]", "ramp_85]")
        .encode(),
    }


def _experiments(source: Path, work: Path) -> str:
    library = Library(source)
    found = []
    for name in ("tiny", "other"):
        experiment, origin = library.experiment(name)
        profiles = check(experiment, origin, library, VIRTUAL if name == "other" else "")
        must(len(profiles) > 0 or experiment.link is None, "no profiles")
        found.append(canonical_json(experiment.model_dump(mode="json")))
    return "\n".join(found)


@cache
def _device_files() -> Files:
    return {"catalog/devices/small.yaml": DEVICE_FILE.encode()}


def _devices(source: Path, work: Path) -> str:
    device = Library(source).device("small")
    limits = device.limits_on(1.0, 4)
    must((limits.cores or 1) >= 1 and (limits.quota_cores or 1) > 0, f"limits of {limits}")
    device.shortfall(limits, 1.0)
    meanings = [device.meaning(engine) for engine in (LOCAL, VIRTUAL)]
    return canonical_json([*meanings, limits.model_dump(mode="json")])


@cache
def _system_files() -> Files:
    return {
        "systems/mine/system.yaml": SYSTEM.encode(),
        "systems/mine/program.sh": b"#!/bin/sh\nexit 0\n",
        "systems/shared.yaml": SHARED.encode(),
    }


def _systems(source: Path, work: Path) -> str:
    system = Library(source).system(str(source / "systems/mine/system.yaml"))
    params = system.resolve(system.choose_variant(None), {})
    found = [system.model_dump(mode="json"), params, system.for_nodes(params)]
    if system.runtime is not None:
        found.append(foreign_digest(system.runtime, source / "systems/mine", {}))
    return canonical_json(found)


@cache
def _dataset_files() -> Files:
    more = {
        "aliases": "[tiny_walk]", "license": "none", "note": "made here", "playback": "{fps: 5}",
        "download": "{url: 'https://example.org/a.tgz', size_bytes: 100, unpack: tar}",
        "reader_options": "{max_difference_s: 0.03, time_unit: s, gray_range: [0, 255]}",
        "close_depth_baselines": "40",
        "camera": CAMERA.replace("bf: 4", "bf: 4, distortion: [0.1, 0.01, 0, 0, 0]"),
    }  # fmt: skip
    files = dict(_tum())
    files["datasets/tiny.yaml"] = recipe(
        reader="tum", depth_unit_m="0.001", groundtruth="groundtruth.txt", **more
    )
    window = b"id: part\ntitle: A part\nwindow_of: tiny\nplayback: {start_s: 0.1, end_s: 0.3}\n"
    return {**files, "datasets/part.yaml": window}


def _dataset(source: Path, work: Path) -> str:
    catalog = Catalog.load(source / "datasets", [source / "data"])
    part = catalog.get("part")
    sequence = catalog.prepare(part.id, work / "cache")
    return f"{sound(sequence)} {part.model_dump_json()}"


# What slambed itself writes and others send.


@cache
def _prepared_files() -> Files:
    with tempfile.TemporaryDirectory() as place:
        write(_tum(), Path(place) / "in")
        Catalog.load(Path(place) / "in/datasets", [Path(place) / "in/data"]).prepare(
            "tiny", Path(place) / "cache"
        )
        folder = next((Path(place) / "cache/prepared").glob("tiny-*"))
        return {f"walk/{file.name}": file.read_bytes() for file in sorted(folder.iterdir())}


def _opened(source: Path, work: Path) -> str:
    return sound(PreparedSequence.open(source / "walk"))


@cache
def _packed_files() -> Files:
    with tempfile.TemporaryDirectory() as place:
        results = Path(place) / "results"
        results_of(results, "tiny", specs(cells=2, runs=2))
        pack(results, ["tiny"], Path(place) / "tiny.tar.xz", False)
        return {"tiny.tar.xz": (Path(place) / "tiny.tar.xz").read_bytes()}


@cache
def _members() -> Files:
    with tarfile.open(fileobj=io.BytesIO(_bytes(_packed_files()["tiny.tar.xz"]))) as stream:
        return {m.name: stream.extractfile(m).read() for m in stream if m.isreg()}  # type: ignore[union-attr]


def _bytes(content: Content) -> bytes:
    assert isinstance(content, bytes)
    return content


def _odd_members(mutator: Mutator) -> Files:
    """Packed files that are whole, of results that are not."""
    r = mutator.random
    members = _members()
    if r.random() < 0.7:
        members = mutator.mutated(members)
    target = io.BytesIO()
    with tarfile.open(fileobj=target, mode="w:xz", preset=0) as out:
        for name in sorted(members, key=lambda name: r.random() if r.random() < 0.1 else 0.0):
            content = members[name]
            member = tarfile.TarInfo(name)
            if r.random() < 0.05:
                new = (
                    "..",
                    "../x/y/z",
                    "/x/y/z",
                    "runs",
                    "a",
                    ".",
                    "",
                    "runs/a",
                    "tiny",
                    "x" * 300,
                )
                member.name = r.choice(new)
                mutator.steps.append(f"{name}: called {member.name[:20]!r}")
            if isinstance(content, Folder):
                member.type = tarfile.DIRTYPE
            elif not isinstance(content, bytes):
                member.type, member.linkname = tarfile.SYMTYPE, content.target
            member.size = len(content) if isinstance(content, bytes) else 0
            out.addfile(member, io.BytesIO(content if isinstance(content, bytes) else b""))
    return {"tiny.tar.xz": target.getvalue()}


def _unpacked(source: Path, work: Path) -> str:
    """What `slambed results unpack`, `size` and `status` do."""
    results = work / "results"
    found, new = unpack(source / "tiny.tar.xz", results)
    if not (results / "tiny/experiment.json").is_file():
        return f"{found} {new}"
    status = status_of(results, "tiny", None, {"test"})
    return f"{found} {new} {[(c.valid, c.missing) for c in status.cells]}"


_KEPT = ("datasets/",)
SUBJECTS = [
    Subject("tum", _tum, prepared, _KEPT),
    Subject("euroc", _euroc, prepared, _KEPT),
    Subject("kitti", _kitti, prepared, _KEPT),
    Subject("seven_scenes", _seven_scenes, prepared, _KEPT),
    *(
        Subject(kind, lambda kind=kind: _bag(kind), prepared, _KEPT, _odd_messages(kind))
        for kind in STORES
    ),
    Subject("trajectory", _trajectories, _evaluated),
    Subject("kitti_poses", _kitti_poses, _evaluated_by_line),
    Subject("trace", _columns, _linked("columns"), ("columns.yaml",)),
    Subject("ping", _ping, _linked("ping", "windows"), ("ping.yaml", "windows.yaml")),
    Subject("mahimahi", _mahimahi, _linked("mahimahi"), ("mahimahi.yaml",)),
    Subject("calibration", _calibrations, _cameras),
    Subject("profile", _made_profiles, _linked("made", "waves", "jumps")),
    Subject("experiment", _experiment_files, _experiments, ("catalog/", "systems/")),
    Subject("device", _device_files, _devices),
    Subject("dataset", _dataset_files, _dataset, ("data/",)),
    Subject("system", _system_files, _systems),
    Subject("packed", _packed_files, _unpacked, (), _odd_members),
    Subject("prepared", _prepared_files, _opened),
]
