# SPDX-License-Identifier: Apache-2.0
"""Exports a prepared sequence to formats of other programs: image folders, or a bag."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from slambed.data.association import MAX_DIFFERENCE_S, match_nearest
from slambed.data.export_part import Part, Progress
from slambed.data.layouts import SENSORS
from slambed.data.prepared import PreparedSequence, move_into_place, partial_folder
from slambed.data.trajectory import Trajectory, write_tum
from slambed.errors import SlambedError, environment_error

FORMATS: dict[str, tuple[str, ...]] = {**SENSORS, "mcap": ("rgbd", "stereo", "mono")}
"""Format -> sensors that it supports: folder layouts, and a bag."""


def export(
    sequence: PreparedSequence,
    layout: str,
    path: Path,
    progress: Progress | None = None,
    *,
    indices: NDArray[np.intp] | None = None,
    with_truth: bool = True,
) -> Path:
    """Writes `path` atomically: tum (rgb/, depth/, lists, groundtruth.txt), euroc (mav0/), kitti
    (image_0, image_1, times.txt, calib.txt, poses.txt) or mcap (a ROS 2 bag).

    Images are gray, as played, for kitti without the distortion of their lens; `indices` selects
    frames, default all. Raises SlambedError for a layout that does not support the sensor, for
    kitti if a frame has no true pose, and if `path` exists.
    """
    if layout not in FORMATS:
        raise SlambedError(f"unknown format '{layout}'; known: {', '.join(FORMATS)}")
    if sequence.info.sensor not in FORMATS[layout]:
        fitting = [name for name, sensors in FORMATS.items() if sequence.info.sensor in sensors]
        raise SlambedError(
            f"{sequence.info.id} is {sequence.info.sensor}, which {layout} does not hold; "
            f"take {' or '.join(fitting)}"
        )
    if path.exists():
        raise SlambedError(f"{path} is there already; choose another folder")
    truth = sequence.groundtruth() if with_truth else None
    if truth is not None and not truth.has_orientation and layout != "tum":
        raise SlambedError(
            f"the ground truth of {sequence.info.id} has positions alone, and {layout} holds "
            "poses; leave it out of the dataset's file"
        )
    every = np.arange(len(sequence))
    part = Part(sequence, every if indices is None else indices, with_truth, progress)
    if truth is not None and layout == "kitti":
        _must_know_all(part, truth)
    partial = partial_folder(path)
    try:
        partial.mkdir(parents=True)
        # The file inside a bag has the name of its folder.
        folder = partial / path.name
        if layout == "mcap":
            from slambed.data.export_bag import write_bag

            write_bag(part, folder)
        else:
            folder.mkdir()
            {"tum": _tum, "euroc": _euroc, "kitti": _kitti}[layout](part, folder)
        move_into_place(folder, path)
    except OSError as error:
        raise environment_error(f"{path}: {error.strerror}; choose another folder") from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return path


def folder_times_ns(sequence: PreparedSequence, layout: str) -> NDArray[np.int64]:
    """Returns the timestamps of all frames in ns, as used in a folder of this layout."""
    times_ns = sequence.index["timestamp_ns"].astype(np.int64)
    # KITTI's times start at the beginning of the sequence.
    return times_ns if layout == "kitti" else times_ns + round(sequence.info.time_origin_s * 1e9)


def _tum(part: Part, folder: Path) -> None:
    lists = {kind: ["# timestamp filename"] for kind in ("rgb", "depth")}
    for kind in lists:
        (folder / kind).mkdir()
    for frame in part.frames():
        stamp = _seconds(frame.timestamp_ns, 6)
        assert frame.second is not None
        for kind, image in (("rgb", frame.gray), ("depth", frame.second)):
            _write(folder / kind / f"{stamp}.png", image)
            lists[kind].append(f"{stamp} {kind}/{stamp}.png")
    for kind, lines in lists.items():
        (folder / f"{kind}.txt").write_text("\n".join(lines) + "\n")
    if (truth := part.truth()) is not None:
        write_tum(folder / "groundtruth.txt", truth)
    info, camera = part.sequence.info, part.sequence.info.camera
    (folder / "camera.txt").write_text(
        "# fx fy cx cy k1 k2 p1 p2 k3 bf, depth steps per meter\n"
        + " ".join(map(repr, (camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion)))
        + f" {camera.bf!r} {1 / info.depth_unit_m:g}\n"
    )


def _euroc(part: Part, folder: Path) -> None:
    info, camera = part.sequence.info, part.sequence.info.camera
    rows: list[str] = []
    for side in (0, 1):
        (folder / "mav0" / f"cam{side}" / "data").mkdir(parents=True)
    for frame in part.frames():
        assert frame.second is not None
        name = f"{frame.timestamp_ns}.png"
        for side, image in enumerate((frame.gray, frame.second)):
            _write(folder / "mav0" / f"cam{side}" / "data" / name, image)
        rows.append(f"{frame.timestamp_ns},{name}")
    for side in (0, 1):
        place = folder / "mav0" / f"cam{side}"
        (place / "data.csv").write_text("\n".join(["#timestamp [ns],filename", *rows]) + "\n")
        # The body frame is the left camera; the right camera is one baseline to its right.
        x_m = side * camera.bf / camera.fx
        (place / "sensor.yaml").write_text(
            "sensor_type: camera\n"
            "T_BS:\n  cols: 4\n  rows: 4\n"
            f"  data: [1, 0, 0, {x_m!r}, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n"
            f"rate_hz: {part.fps:g}\nresolution: [{info.width}, {info.height}]\n"
            "camera_model: pinhole\n"
            f"intrinsics: [{camera.fx!r}, {camera.fy!r}, {camera.cx!r}, {camera.cy!r}]\n"
            "distortion_model: radial-tangential\ndistortion_coefficients: [0.0, 0.0, 0.0, 0.0]\n"
        )
    if (truth := part.truth()) is not None:
        place = folder / "mav0" / "state_groundtruth_estimate0"
        place.mkdir()
        lines = ["#timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z"]
        for t_s, x, y, z, qx, qy, qz, qw in truth.rows().tolist():
            lines.append(f"{round(t_s * 1e9)},{x!r},{y!r},{z!r},{qw!r},{qx!r},{qy!r},{qz!r}")
        (place / "data.csv").write_text("\n".join(lines) + "\n")


def _kitti(part: Part, folder: Path) -> None:
    camera = part.sequence.info.camera
    stereo = part.sequence.info.sensor == "stereo"
    for side in (0, 1) if stereo else (0,):
        (folder / f"image_{side}").mkdir()
    # calib.txt has no place for distortion. Stereo pictures have none.
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    lens = np.array(camera.distortion)
    for index, frame in enumerate(part.frames()):
        gray = frame.gray
        if lens.any():
            gray = np.asarray(cv2.undistort(gray, matrix, lens), np.uint8)
        _write(folder / "image_0" / f"{index:06d}.png", gray)
        if frame.second is not None:
            _write(folder / "image_1" / f"{index:06d}.png", frame.second)
    times = [_seconds(int(t), 9) for t in folder_times_ns(part.sequence, "kitti")[part.indices]]
    (folder / "times.txt").write_text("\n".join(times) + "\n")
    rows = [
        f"P{side}: {camera.fx!r} 0 {camera.cx!r} {-side * camera.bf!r} "
        f"0 {camera.fy!r} {camera.cy!r} 0 0 0 1 0"
        for side in (0, 1)
    ]
    (folder / "calib.txt").write_text("\n".join(rows) + "\n")
    if (truth := part.truth()) is not None:
        poses = _at_frames(part, truth)
        np.savetxt(folder / "poses.txt", poses.reshape(-1, 12), fmt="%.9e")


def _must_know_all(part: Part, truth: Trajectory) -> None:
    """Raises SlambedError if a frame has no measured pose near it, and none soon before and after
    it to interpolate between: poses.txt has a line for each frame, which would be invented."""
    from slambed.data.camera_motion import LONGEST_GAP_S  # loads scipy

    times_s, stamps_s = part.recorded_s, truth.stamps_s
    gaps_s = np.diff(stamps_s, prepend=-np.inf, append=np.inf)
    known = gaps_s[np.searchsorted(stamps_s, times_s)] <= LONGEST_GAP_S
    known[match_nearest(times_s, stamps_s, MAX_DIFFERENCE_S)[0]] = True
    if known.all():
        return
    info = part.sequence.info
    others = [name for name in FORMATS if name != "kitti" and info.sensor in FORMATS[name]]
    raise SlambedError(
        f"the ground truth of {info.id} has no pose for {np.count_nonzero(~known)} of {len(known)} "
        f"frames, the first at {part.sequence.times_s[part.indices][~known][0]:.3f} s, and kitti "
        f"holds one for each; take {' or '.join(others)}, or leave the ground truth out of the "
        "dataset's file"
    )


def _at_frames(part: Part, truth: Trajectory) -> NDArray[np.float64]:
    """Returns the true pose of every frame (n, 3, 4), interpolated between measurements."""
    from scipy.spatial.transform import Slerp

    times_s = part.recorded_s
    inside = np.clip(times_s, truth.stamps_s[0], truth.stamps_s[-1])
    poses = np.zeros((len(times_s), 3, 4))
    poses[:, :, :3] = Slerp(truth.stamps_s, truth.rotations())(inside).as_matrix()
    for axis in range(3):
        poses[:, axis, 3] = np.interp(inside, truth.stamps_s, truth.positions_m[:, axis])
    return poses


def _write(path: Path, image: NDArray[np.uint8] | NDArray[np.uint16]) -> None:
    good, encoded = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    assert good
    path.write_bytes(encoded.tobytes())


def _seconds(time_ns: int, digits: int) -> str:
    """Formats exactly: a float of seconds since 1970 would lose precision."""
    unit = 10 ** (9 - digits)
    steps = (time_ns + unit // 2) // unit
    whole, rest = divmod(abs(steps), 10**digits)
    return f"{'-' if steps < 0 else ''}{whole}.{rest:0{digits}d}"
