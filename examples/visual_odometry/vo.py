# SPDX-License-Identifier: Apache-2.0
# ruff: noqa: N806 - T_wc: camera to world
"""RGB-D visual odometry on OpenCV: every frame against the last keyframe, ORB and PnP, no map."""

from typing import Any

import cv2
import numpy as np

REPROJECTION_PX = 3.0
RATIO = 0.8  # of the best match's distance to the second best's (Lowe, IJCV 2004)


class Odometry:
    """camera: what is known of it, as `Client` has it; params: those of system.yaml."""

    def __init__(self, camera: Any, params: dict[str, Any]) -> None:
        self.camera, self.params = camera, params
        self.orb = cv2.ORB_create(nfeatures=params["n_orb"])
        self.matcher = cv2.BFMatcher(cv2.NORM_HAMMING)
        self.points = np.empty((0, 3))  # of the keyframe, in its camera
        self.descriptors = None
        self.T_wk = np.eye(4)  # keyframe to world
        self.T_ck = np.eye(4)  # keyframe to the last camera: where the next one is looked for

    def keyframe(self, depth: np.ndarray, pixels: np.ndarray, descriptors: np.ndarray) -> None:
        x, y = pixels.round().astype(int).T
        depth_m = depth[y, x] * self.camera.depth_unit_m
        ideal = cv2.undistortPoints(pixels, self.camera.camera_matrix, self.camera.distortion)
        seen = depth_m > 0
        rays = np.column_stack([ideal[:, 0], np.ones(len(ideal))])
        self.points, self.descriptors = (rays * depth_m[:, None])[seen], descriptors[seen]

    def track(self, gray: np.ndarray, depth: np.ndarray) -> tuple[np.ndarray | None, int, int]:
        """Camera to world or None, features, inliers."""
        keypoints, descriptors = self.orb.detectAndCompute(gray, None)
        if descriptors is None:
            return None, 0, 0
        pixels = np.array([k.pt for k in keypoints])
        if self.descriptors is None:
            self.keyframe(depth, pixels, descriptors)
            return self.T_wk, len(pixels), 0
        pairs = [p for p in self.matcher.knnMatch(descriptors, self.descriptors, k=2) if len(p) > 1]
        good = [best for best, second in pairs if best.distance < RATIO * second.distance]
        inliers = None
        if len(good) >= self.params["min_inliers"]:
            _, r, t, inliers = cv2.solvePnPRansac(
                self.points[[m.trainIdx for m in good]],
                pixels[[m.queryIdx for m in good]],
                self.camera.camera_matrix,
                self.camera.distortion,
                cv2.Rodrigues(self.T_ck[:3, :3])[0],
                self.T_ck[:3, 3].copy(),
                True,
                reprojectionError=REPROJECTION_PX,
            )
        count = 0 if inliers is None else len(inliers)
        if count < self.params["min_inliers"]:
            return None, len(pixels), count
        self.T_ck = np.eye(4)
        self.T_ck[:3, :3], self.T_ck[:3, 3] = cv2.Rodrigues(r)[0], t.ravel()
        T_wc = self.T_wk @ np.linalg.inv(self.T_ck)
        if count < self.params["new_keyframe_below"]:
            self.T_wk, self.T_ck = T_wc, np.eye(4)
            self.keyframe(depth, pixels, descriptors)
        return T_wc, len(pixels), count
