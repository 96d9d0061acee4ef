# SPDX-License-Identifier: Apache-2.0
"""The odometry as a program that knows nothing of slambed: it reads a folder in TUM's layout and
leaves a trajectory.

python3 read_folder.py FOLDER TRAJECTORY
"""

import json
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
from vo import Odometry


def camera_of(folder: Path) -> SimpleNamespace:
    fx, fy, cx, cy, *distortion, _, steps_per_m = np.loadtxt(folder / "camera.txt")
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    return SimpleNamespace(
        camera_matrix=matrix, distortion=np.array(distortion), depth_unit_m=1 / steps_per_m
    )


def entries(list_file: Path) -> list[list[str]]:
    """Time stamp and file of every picture."""
    lines = list_file.read_text().splitlines()
    return [line.split() for line in lines if not line.startswith("#")]


def main() -> None:
    folder, trajectory = Path(sys.argv[1]), Path(sys.argv[2])
    cv2.setNumThreads(1)
    cv2.setRNGSeed(int(os.environ.get("SLAMBED_SEED", "1")))
    odometry = Odometry(camera_of(folder), json.loads(os.environ["SLAMBED_PARAMS"]))
    lines = []
    pairs = zip(entries(folder / "rgb.txt"), entries(folder / "depth.txt"), strict=True)
    for (stamp, gray), (_, depth) in pairs:
        T_wc, _, _ = odometry.track(  # noqa: N806 - camera to world
            cv2.imread(str(folder / gray), cv2.IMREAD_GRAYSCALE),
            cv2.imread(str(folder / depth), cv2.IMREAD_UNCHANGED),
        )
        if T_wc is not None:
            pose = [*T_wc[:3, 3], *quaternion(T_wc[:3, :3])]
            lines.append(" ".join([stamp, *(f"{number:.9f}" for number in pose)]))
    trajectory.write_text("\n".join(lines) + "\n")


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """x y z w, by way of the rotation's axis and angle."""
    vector = cv2.Rodrigues(rotation)[0].ravel()
    angle = np.linalg.norm(vector)
    axis = vector / angle if angle > 0 else vector
    return np.array([*(np.sin(angle / 2) * axis), np.cos(angle / 2)])


if __name__ == "__main__":
    main()
