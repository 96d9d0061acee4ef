# SPDX-License-Identifier: Apache-2.0
"""The trajectory file of a system that reads a recorded folder: checked, and converted to the
frames, losses and poses that every system reports."""

import json
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slambed.campaign.left_files import must_be_a_file
from slambed.campaign.recordings import Recording
from slambed.data.trajectory import Trajectory, read_tum, write_tum
from slambed.engines.result import RunResult
from slambed.errors import SlambedError
from slambed.files.atomic import replacing
from slambed.spec.runtime import Runtime

SAME_STAMP_S = 1e-3
"""A system may write timestamps with only three decimals."""
UNIT_TOLERANCE = 1e-3
"""Tolerance of a quaternion's norm and of R R^T - I: it allows single precision and few
decimals, as for poses received by slambed-play."""
KITTI_NUMBERS = 12


def read_poses(path: Path, runtime: Runtime, recording: Recording) -> Trajectory:
    """Reads the poses of a file, in the folder's timestamps; each line of a KITTI file is one
    frame.

    Raises SlambedError for a missing or malformed file.
    """
    must_be_a_file(path)
    if runtime.trajectory_format == "tum":
        try:
            poses = read_tum(path)
        except SlambedError as error:
            # Only the name: the folder is gone when the user reads this.
            raise SlambedError(str(error).replace(str(path), path.name)) from None
        if not len(poses):
            raise SlambedError(f"{path.name}: no pose in it; write a line for each tracked frame")
        return poses
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # an empty file is refused below
            rows = np.loadtxt(path, dtype=np.float64, ndmin=2)
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise SlambedError(f"{path.name}: cannot be read as KITTI's poses ({reason})") from None
    if not rows.size:
        raise SlambedError(f"{path.name}: no pose in it; write a line for each frame")
    if not np.isfinite(rows).all():
        line = int(np.argmin(np.isfinite(rows).all(axis=1))) + 1
        raise SlambedError(f"{path.name}: the pose of line {line} has nan or inf; write numbers")
    if rows.shape != (len(recording.indices), KITTI_NUMBERS):
        shape = " x ".join(map(str, rows.shape))
        raise SlambedError(
            f"{path.name}: {shape} numbers; KITTI's poses have no times, so write "
            f"{KITTI_NUMBERS} for each of the {len(recording.indices)} frames, or "
            "trajectory_format: tum"
        )
    matrices = rows.reshape(-1, 3, 4)
    rotations = matrices[:, :, :3]
    with np.errstate(all="ignore"):  # numbers too large for a product are no rotation either
        off = np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        wrong = ~(off <= UNIT_TOLERANCE) | (np.linalg.det(rotations) < 0)
    if wrong.any():
        raise SlambedError(
            f"{path.name}: the pose of line {int(np.argmax(wrong)) + 1} is no rotation; write "
            "[R | t], camera to world, with R of determinant 1"
        )
    return Trajectory.of_matrices(recording.folder_stamps_s, matrices)


def check_rotations(path: Path, poses: Trajectory) -> None:
    """Raises SlambedError for a quaternion that does not have length 1."""
    lengths = np.linalg.norm(poses.quaternions_xyzw, axis=1)
    wrong = np.abs(lengths - 1) > UNIT_TOLERANCE
    if wrong.any():
        first = int(np.argmax(wrong))
        raise SlambedError(
            f"{path.name}: the pose at {poses.stamps_s[first]:.6f} s is no rotation, its "
            f"quaternion has length {lengths[first]:.4f}; write a unit quaternion x y z w"
        )


def frames_of(path: Path, poses: Trajectory, recording: Recording) -> NDArray[np.intp]:
    """Returns for each pose the position of its frame in the recording.

    Raises SlambedError for a time without a frame, and for two poses of one frame.
    """
    stamps_s = recording.folder_stamps_s
    right = np.clip(np.searchsorted(stamps_s, poses.stamps_s), 1, max(1, len(stamps_s) - 1))
    right = np.minimum(right, len(stamps_s) - 1)
    left = np.maximum(right - 1, 0)
    nearer = np.abs(stamps_s[left] - poses.stamps_s) <= np.abs(stamps_s[right] - poses.stamps_s)
    places = np.where(nearer, left, right)
    wrong = np.abs(stamps_s[places] - poses.stamps_s) > SAME_STAMP_S
    if wrong.any():
        raise SlambedError(
            f"{path.name}: {int(wrong.sum())} of {len(poses)} poses have the time of no frame, "
            f"the first one {poses.stamps_s[int(np.argmax(wrong))]:.6f} s; write the time stamps "
            f"of the folder, in seconds ({stamps_s[0]:.6f} to {stamps_s[-1]:.6f})"
        )
    if (twice := np.flatnonzero(np.diff(places) == 0)).size:
        raise SlambedError(
            f"{path.name}: two poses of the frame at {stamps_s[places[int(twice[0])]]:.6f} s; "
            "write one a frame"
        )
    return places


def record_poses(result: RunResult, runtime: Runtime, recording: Recording, raw: Path) -> RunResult:
    """Writes `mobile/trajectory.txt`, in recorded time, and appends the frames' events to those
    of the player. An invalid trajectory makes the outcome `died`."""
    if result.outcome != "completed":
        return result
    folder = raw / "mobile"
    path = folder / runtime.trajectory
    try:
        poses = read_poses(path, runtime, recording)
        check_rotations(path, poses)
        places = frames_of(path, poses, recording)
    except SlambedError as error:
        (folder / "trajectory.txt").unlink(missing_ok=True)
        return replace(result, outcome="died", reason=f"mobile node: {error}")
    kept = Trajectory(recording.recorded_s[places], poses.positions_m, poses.quaternions_xyzw)
    with replacing(folder / "trajectory.txt") as out:
        write_tum(out, kept)
    log = folder / "events.jsonl"
    t_ns = round(1e9 * (result.mobile_until_s or 0.0))
    before = log.read_text() if log.exists() else ""
    with replacing(log) as out:
        lines = [json.dumps({"t_ns": t_ns, **e}) + "\n" for e in _events(recording, places)]
        out.write_text(before + "".join(lines))
    return result


def _events(recording: Recording, places: NDArray[np.intp]) -> Iterator[dict[str, Any]]:
    """Yields the same events as the player for frames with and without a pose
    (frame_record.cpp). When each frame was tracked, and how long it took, is unknown."""
    posed = np.zeros(len(recording.indices), dtype=bool)
    posed[places] = True
    before, ever = "not_initialized", False
    for index, seq_s, good in zip(recording.indices, recording.seq_s, posed, strict=True):
        frame = {"frame": int(index), "seq_s": round(float(seq_s), 9)}
        ever = ever or bool(good)
        state = "ok" if good else ("lost" if ever else "not_initialized")
        if before == "ok" and state != "ok":
            yield {"type": "track_lost", **frame}
        if state == "ok" and before != "ok":
            yield {"type": "initialized" if before == "not_initialized" else "relocalized", **frame}
        before = state
        yield {"type": "frame_tracked", **frame, "state": state}
