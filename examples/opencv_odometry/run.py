# SPDX-License-Identifier: Apache-2.0
"""OpenCV's RGB-D odometry as a system of slambed: every frame against the last one with a pose."""

import cv2
import numpy as np
from slambed_client import Client

client = Client()
settings = cv2.OdometrySettings()
settings.setCameraMatrix(client.camera_matrix.astype(np.float32))
settings.setMaxDepth(client.params["max_depth_m"])
odometry = cv2.Odometry(cv2.OdometryType_RGB_DEPTH, settings, cv2.OdometryAlgoType_COMMON)
pose, previous = np.eye(4), None  # camera to world
client.ready()
for frame in client:
    # Copies: the client reuses the memory of its frames.
    now = (frame.depth * client.depth_unit_m).astype(np.float32), frame.gray.copy()
    if previous is not None:
        found, step = odometry.compute(*previous, *now)
        if not found:
            client.lost(frame)
            continue
        pose = pose @ np.linalg.inv(step)
    client.pose(frame, pose)
    previous = now
client.close()
