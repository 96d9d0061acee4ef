# SPDX-License-Identifier: Apache-2.0
# ruff: noqa: N806 - T_wc: camera to world
"""ORB-SLAM3 (the package pyorbslam3) as a system of slambed: RGB-D, stereo, or one camera."""

import os
import sys
import time
from pathlib import Path

import numpy as np
from pyorbslam3 import Sensor, Slam, TrackingState
from slambed_client import Client
from vocabulary import as_dbow2_text

OUTPUT = Path(os.environ["SLAMBED_OUTPUT"])
SENSORS = {"rgbd": Sensor.RGBD, "stereo": Sensor.STEREO, "mono": Sensor.MONOCULAR}
TRACKED = {TrackingState.OK, TrackingState.OK_KLT}
WITHOUT_MAP = {
    TrackingState.SYSTEM_NOT_READY,
    TrackingState.NO_IMAGES_YET,
    TrackingState.NOT_INITIALIZED,
}


def camera_of(client: Client, number: int) -> dict[str, float]:
    """Returns the settings of one camera. Both cameras of a rectified pair are the same."""
    # Pictures of two cameras are rectified already, and have no distortion.
    distortion = (0.0,) * 5 if client.sensor == "stereo" else client.distortion
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
    values = (client.fx, client.fy, client.cx, client.cy, *distortion)
    return {
        f"Camera{number}.{name}": value
        for name, value in zip(names, values, strict=True)
        if value or name != "k3"
    }


def second_camera(baseline_m: float) -> np.ndarray:
    """Returns the pose of the right camera in the left one."""
    T_c1_c2 = np.eye(4)
    T_c1_c2[0, 3] = baseline_m
    return T_c1_c2


def matrix_as_text(matrix: np.ndarray) -> str:
    """Returns a matrix as OpenCV's YAML has it."""
    rows, columns = matrix.shape
    numbers = ", ".join(repr(float(value)) for value in matrix.ravel())
    head = f"!!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: f\n"
    return f"{head}   data: [{numbers}]"


def settings_of(client: Client) -> str:
    """Returns the settings file for the camera of this run."""
    lines = {
        "File.version": '"1.0"',
        # The package ends with a segmentation fault on "Rectified", ORB_SLAM3's issue 677.
        "Camera.type": '"PinHole"',
        **camera_of(client, 1),
        "Camera.width": client.width,
        "Camera.height": client.height,
        "Camera.fps": max(1, round(client.fps)),
        "Camera.RGB": 1,
        "ORBextractor.nFeatures": client.params["n_orb"],
        "ORBextractor.scaleFactor": 1.2,
        "ORBextractor.nLevels": 8,
        "ORBextractor.iniThFAST": 20,
        "ORBextractor.minThFAST": 7,
        # Read even without a viewer.
        "Viewer.KeyFrameSize": 0.05,
        "Viewer.KeyFrameLineWidth": 1.0,
        "Viewer.GraphLineWidth": 0.9,
        "Viewer.PointSize": 2.0,
        "Viewer.CameraSize": 0.08,
        "Viewer.CameraLineWidth": 3.0,
        "Viewer.ViewpointX": 0.0,
        "Viewer.ViewpointY": -0.7,
        "Viewer.ViewpointZ": -1.8,
        "Viewer.ViewpointF": 500.0,
    }
    if client.sensor != "mono":
        lines["Stereo.ThDepth"] = client.params["th_depth"]
    if client.sensor == "rgbd":
        lines["Stereo.b"] = client.bf / client.fx
        lines["RGBD.DepthMapFactor"] = 1.0 / client.depth_unit_m
    if client.sensor == "stereo":
        lines |= camera_of(client, 2)
        lines["Stereo.T_c1_c2"] = matrix_as_text(second_camera(client.bf / client.fx))
    # OpenCV tells real numbers from integers by the point.
    text = {k: repr(float(v)) if isinstance(v, float) else v for k, v in lines.items()}
    return "%YAML:1.0\n" + "".join(f"{key}: {value}\n" for key, value in text.items())


def is_saved(slam: Slam, file: Path, sensor: str) -> bool:
    """Lets a process of its own save the path: the package ends with a segmentation fault if its
    last map has no keyframe. The poses of the run itself are kept then. With one camera it saves
    its largest map only, because each map has another scale, and only in EuRoC's format."""
    child = os.fork()
    if child == 0:
        saved = False
        try:
            if sensor == "mono":
                slam.save_trajectory_euroc(str(file))
            else:
                slam.save_trajectory_tum(str(file))
            saved = True
        finally:  # an exception must not go on to play the rest of the run a second time
            os._exit(0 if saved else 1)
    _, status = os.waitpid(child, 0)
    saved = status == 0 and file.is_file()
    if not saved:
        print("no corrected poses: the package could not save them")
    return saved


def final_poses(slam: Slam, client: Client, times_s: dict[float, int], tracked: set[int]) -> None:
    """Sends the corrected poses of tracked frames, as ORB-SLAM3 leaves them after its end. Its file
    also has frames in which it was about to lose track."""
    file = OUTPUT / "orb_slam3.txt"
    if not is_saved(slam, file, client.sensor):
        return
    stamps = np.array(sorted(times_s))
    for row in np.loadtxt(file, ndmin=2):
        if client.sensor == "mono":  # EuRoC's format has nanoseconds
            row[0] *= 1e-9
        nearest = stamps[np.argmin(abs(stamps - row[0]))]
        if (frame := times_s[nearest]) in tracked:
            client.final(frame, matrix_of(row[1:]))


def matrix_of(pose: np.ndarray) -> np.ndarray:
    """Returns 4x4 of `tx ty tz qx qy qz qw`."""
    x, y, z, w = pose[3:] / np.linalg.norm(pose[3:])
    T_wc = np.eye(4)
    T_wc[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    T_wc[:3, 3] = pose[:3]
    return T_wc


def main() -> None:
    client = Client()
    settings, words = OUTPUT / "settings.yaml", OUTPUT / "vocabulary.txt"
    settings.write_text(settings_of(client))
    began = time.monotonic()
    given = Path(client.params["vocabulary"])
    slam = Slam(as_dbow2_text(given, words), settings, SENSORS[client.sensor])
    words.unlink(missing_ok=True)
    client.ready()
    client.event("loaded", seconds=time.monotonic() - began)
    times_s: dict[float, int] = {}
    tracked: set[int] = set()
    for frame in client:
        times_s[frame.seq_s] = frame.index
        if client.sensor == "rgbd":
            # Depth in raw units: the settings hold the factor to meters.
            found = slam.track_rgbd(frame.gray, frame.depth.astype(np.float32), frame.seq_s)
        elif client.sensor == "stereo":
            found = slam.track_stereo(frame.gray, frame.right, frame.seq_s)
        else:
            found = slam.track_monocular(frame.gray, frame.seq_s)
        if found.state in TRACKED and found.pose_valid:
            tracked.add(frame.index)
            client.pose(frame, found.pose_wc, inliers=found.num_tracked_points)
        elif found.state in WITHOUT_MAP:
            client.not_initialized(frame)
        else:
            client.lost(frame)
    slam.shutdown()
    final_poses(slam, client, times_s, tracked)
    client.close()


if __name__ == "__main__":
    sys.exit(main())
