# SPDX-License-Identifier: Apache-2.0
"""Measures how difficult a sequence is for tracking after missing frames: feature matches over time
gaps.

Features are OpenCV's ORB, distributed over the image. They are matched by descriptor only, with the
limits of ORB-SLAM2's fallback to the reference keyframe (`TrackReferenceKeyFrame`: 50 bits, ratio
0.7). Correct matches are known from the ground truth. No SLAM system is involved, so recorded and
generated sequences can be compared before any run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from slambed.data.camera_motion import (
    CameraMotion,
    camera_matrix,
    epipolar_distance_px,
    moved_to,
    rays_of,
)
from slambed.data.model import GrayImage
from slambed.data.prepared import PreparedSequence
from slambed.errors import SlambedError

Floats = NDArray[np.float64]

GAPS_S = (0.1, 0.2, 0.5, 1.0, 1.5, 2.0)
STEP_S = 0.5
"""Time between the first images of successive pairs."""
MOST_STARTS = 120
FEATURES = 1000
GRID = (8, 10)
"""Rows and columns: each cell keeps its strongest features, like extractors of SLAM systems do."""
LARGEST_DISTANCE, RATIO = 50, 0.7
RIGHT_PX = 8.0
"""Maximum distance of a correct match from the position given by ground truth and depth."""
EPIPOLAR_PX = 2.0
"""The same without depth: maximum distance from the epipolar line."""
OCCLUSION_SHARE = 0.1
"""A point whose expected depth exceeds the measured depth by more than this share is occluded."""
RANSAC_PX, LEAST_MATCHES = 5.0, 15
CONFIDENCE, ITERATIONS = 0.99, 300

Judge = Literal["depth", "epipolar line"]


@dataclass(frozen=True)
class Features:
    """Features of one image: pixels [N,2], descriptors [N,32], depth in meters [N] (0: unknown)."""

    pixels: Floats
    descriptors: NDArray[np.uint8]
    depths_m: Floats

    def __len__(self) -> int:
        return len(self.pixels)


@dataclass(frozen=True)
class Pair:
    """Two images: matched feature indices [M,2] (first, second), and which matches are correct."""

    first: Features
    second: Features
    matches: NDArray[np.intp]
    right: NDArray[np.bool_]
    judged: NDArray[np.bool_]
    """Matches whose first feature has a depth; without depth images, all matches."""
    visible: int
    """Number of features of the first image that should be visible in the second."""
    flow_px: float
    inliers: int
    """Matches that agree with one pose, or one epipolar geometry, found by RANSAC."""


@dataclass(frozen=True)
class GapDifficulty:
    """Means over all pairs with this time gap; the flow is a median."""

    gap_s: float
    pairs: int
    matches: float
    right_per_visible: float
    precision: float
    inliers: float
    tracked_share: float
    """Share of pairs with the 15 matches that the fallback requires."""
    flow_px: float


@dataclass(frozen=True)
class Difficulty:
    """The difficulty of one sequence."""

    id: str
    judge: Judge
    features: float
    """Mean number per image."""
    depth_share: float
    """Share of features with a depth; 0 without a depth camera."""
    median_depth_m: float
    gaps: tuple[GapDifficulty, ...]


def features_of(sequence: PreparedSequence, frame: int) -> Features:
    """Returns the strongest ORB features of each grid cell."""
    gray = sequence.gray(frame)
    orb = cv2.ORB.create(nfeatures=4 * FEATURES, fastThreshold=7)
    found, descriptors = orb.detectAndCompute(np.ascontiguousarray(gray), None)
    if descriptors is None:
        found, descriptors = (), np.empty((0, 32), np.uint8)
    kept = _spread(found, gray)
    pixels = np.array([found[i].pt for i in kept], np.float64).reshape(-1, 2)
    return Features(
        pixels, np.asarray(descriptors, np.uint8)[kept], _depths(sequence, frame, pixels)
    )


def _spread(found: Sequence[cv2.KeyPoint], gray: GrayImage) -> list[int]:
    height, width = gray.shape
    rows, columns = GRID
    room = np.full(GRID, -(-FEATURES // (rows * columns)))
    kept = []
    for i in sorted(range(len(found)), key=lambda i: (-found[i].response, i)):
        x, y = found[i].pt
        cell = int(y * rows / height), int(x * columns / width)
        if room[cell] > 0:
            room[cell] -= 1
            kept.append(i)
    return kept


def _depths(sequence: PreparedSequence, frame: int, pixels: Floats) -> Floats:
    second = sequence.second(frame)
    if sequence.info.sensor != "rgbd" or second is None:
        return np.zeros(len(pixels))
    column, row = np.rint(pixels).astype(int).T.reshape(2, -1)
    inside = np.clip(row, 0, second.shape[0] - 1), np.clip(column, 0, second.shape[1] - 1)
    depths: Floats = second[inside].astype(np.float64) * sequence.info.depth_unit_m
    return depths


def match(first: Features, second: Features) -> NDArray[np.intp]:
    """Returns matches [M,2] whose descriptors are close and clearly closer than the second best."""
    if len(first) == 0 or len(second) < 2:
        return np.empty((0, 2), np.intp)
    matcher = cv2.BFMatcher(cv2.NORM_HAMMING)
    pairs = [
        (best.queryIdx, best.trainIdx)
        for best, other in matcher.knnMatch(first.descriptors, second.descriptors, k=2)
        if best.distance <= LARGEST_DISTANCE and best.distance < RATIO * other.distance
    ]
    return np.array(pairs, np.intp).reshape(-1, 2)


def compare(
    sequence: PreparedSequence,
    motion: CameraMotion,
    first: tuple[int, Features],
    second: tuple[int, Features],
) -> Pair:
    """Matches the features of two frames and evaluates the matches."""
    (frame, own), (other, there) = first, second
    matches = match(own, there)
    camera, relative = sequence.info.camera, motion.between(frame, other)
    if sequence.info.sensor == "rgbd":
        with_depth = own.depths_m > 0
        expected, depths_m = moved_to(camera, relative, own.pixels, own.depths_m)
        visible = with_depth & _seen(sequence, other, expected, depths_m)
        away_px = np.linalg.norm(expected[matches[:, 0]] - there.pixels[matches[:, 1]], axis=1)
        right = with_depth[matches[:, 0]] & (away_px <= RIGHT_PX)
        judged = with_depth[matches[:, 0]]
        flow = np.linalg.norm(expected - own.pixels, axis=1)[visible]
    else:
        ends = own.pixels[matches[:, 0]], there.pixels[matches[:, 1]]
        right = epipolar_distance_px(camera, relative, *ends) <= EPIPOLAR_PX
        judged, visible = np.ones(len(matches), np.bool_), np.ones(len(own), np.bool_)
        flow = np.linalg.norm(ends[1] - ends[0], axis=1)[right]
    return Pair(
        own,
        there,
        matches,
        right,
        judged,
        int(visible.sum()),
        float(np.median(flow)) if len(flow) else float("nan"),
        _inliers(sequence, own, there, matches),
    )


def _seen(
    sequence: PreparedSequence, frame: int, expected: Floats, depths_m: Floats
) -> NDArray[np.bool_]:
    """Returns which points are inside the image and not occluded by the measured depth."""
    info = sequence.info
    inside = (depths_m > 0) & (expected >= 0).all(axis=1)
    inside &= (expected[:, 0] < info.width - 1) & (expected[:, 1] < info.height - 1)
    measured = np.zeros(len(expected))
    measured[inside] = _depths(sequence, frame, expected[inside])
    hidden = (measured > 0) & (measured < (1 - OCCLUSION_SHARE) * depths_m)
    return inside & ~hidden


def _inliers(
    sequence: PreparedSequence, own: Features, there: Features, matches: NDArray[np.intp]
) -> int:
    camera = sequence.info.camera
    matrix, lens = camera_matrix(camera), np.array(camera.distortion)
    cv2.setRNGSeed(1)
    if sequence.info.sensor == "rgbd":
        matches = matches[own.depths_m[matches[:, 0]] > 0]
    pixels, others = own.pixels[matches[:, 0]], there.pixels[matches[:, 1]]
    if len(matches) < LEAST_MATCHES:
        return 0
    if sequence.info.sensor == "rgbd":
        points = rays_of(camera, pixels) * own.depths_m[matches[:, :1]]
        good, _, _, inliers = cv2.solvePnPRansac(
            points,
            others,
            matrix,
            lens,
            iterationsCount=ITERATIONS,
            reprojectionError=RANSAC_PX,
            confidence=CONFIDENCE,
        )
        return len(inliers) if good and inliers is not None else 0
    _, agree = cv2.findEssentialMat(pixels, others, matrix, cv2.RANSAC, CONFIDENCE, EPIPOLAR_PX)
    return 0 if agree is None else int(np.count_nonzero(agree))


def measure(sequence: PreparedSequence, gaps_s: tuple[float, ...] = GAPS_S) -> Difficulty:
    """Measures a prepared sequence. Raises SlambedError if it has no ground truth."""
    motion = CameraMotion.of(sequence)
    pairs: dict[float, list[Pair]] = {gap_s: [] for gap_s in gaps_s}
    firsts: list[Features] = []
    seen: dict[int, Features] = {}

    def look(frame: int) -> tuple[int, Features]:
        if frame not in seen:
            seen[frame] = features_of(sequence, frame)
        return frame, seen[frame]

    for start in _starts(sequence, motion):
        first = look(start)
        firsts.append(first[1])
        for gap_s in gaps_s:
            other = _frame_at(sequence, sequence.times_s[start] + gap_s)
            if other is not None and other > start and motion.knows(other):
                pairs[gap_s].append(compare(sequence, motion, first, look(other)))
    if not firsts:
        raise SlambedError(
            f"{sequence.info.id}: no frame has a true pose; its ground truth ends before it begins"
        )
    depths = np.concatenate([one.depths_m for one in firsts])
    known = depths[depths > 0]
    return Difficulty(
        id=sequence.info.id,
        judge="depth" if sequence.info.sensor == "rgbd" else "epipolar line",
        features=float(np.mean([len(one) for one in firsts])),
        depth_share=len(known) / max(1, len(depths)),
        median_depth_m=float(np.median(known)) if len(known) else float("nan"),
        gaps=tuple(_summary(gap_s, own) for gap_s, own in pairs.items() if own),
    )


def _starts(sequence: PreparedSequence, motion: CameraMotion) -> Iterator[int]:
    step_s = max(STEP_S, sequence.duration_s / MOST_STARTS)
    for time_s in np.arange(0.0, sequence.duration_s, step_s):
        frame = int(np.searchsorted(sequence.times_s, time_s))
        if motion.knows(frame):
            yield frame


def _frame_at(sequence: PreparedSequence, time_s: float) -> int | None:
    times_s = sequence.times_s
    if time_s > times_s[-1]:
        return None
    return int(np.argmin(np.abs(times_s - time_s)))


def _summary(gap_s: float, pairs: list[Pair]) -> GapDifficulty:
    judged = sum(int(pair.judged.sum()) for pair in pairs)
    right = sum(int(pair.right.sum()) for pair in pairs)
    flows = np.array([pair.flow_px for pair in pairs])
    return GapDifficulty(
        gap_s=gap_s,
        pairs=len(pairs),
        matches=float(np.mean([len(pair.matches) for pair in pairs])),
        right_per_visible=right / max(1, sum(pair.visible for pair in pairs)),
        precision=right / judged if judged else float("nan"),
        inliers=float(np.mean([pair.inliers for pair in pairs])),
        tracked_share=float(np.mean([len(pair.matches) >= LEAST_MATCHES for pair in pairs])),
        flow_px=float(np.nanmedian(flows)) if np.isfinite(flows).any() else float("nan"),
    )
