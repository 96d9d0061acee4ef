# SPDX-License-Identifier: Apache-2.0
"""Turns the maps of our network (tools/train_people.py) into person instances.

A center is a peak of the first map. Of centers whose boxes overlap by more than n_m (intersection
over union), only the best is kept. Every mask pixel belongs to the center that it votes for.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from slambed.segment.instances import KEYPOINTS, Instance, Keypoints, Mask, Segmented

Maps = NDArray[np.float32]
INPUT_WIDTH, INPUT_HEIGHT = 320, 256
CELL_PX = 4
"""Size of a map cell, in pixels of the input."""
REACH_PX = 64.0
"""Unit of votes and boxes."""
MASK_LEVEL, MIDDLE_LEVEL, KEYPOINT_LEVEL = 0.5, 0.3, 0.2
MOST_MIDDLES = 20
LEAST_SHARE = 0.0004
"""Smallest fraction of the image that counts as a person."""
FARTHEST_VOTE = 0.8
"""Farthest vote for a center, relative to the side of a square with the box's area."""


@dataclass(frozen=True)
class Middle:
    """One candidate center: cell, box in cells, score."""

    u: float
    v: float
    width: float
    height: float
    score: float

    def overlap(self, other: Middle) -> float:
        wide = (self.width + other.width) / 2 - abs(self.u - other.u)
        tall = (self.height + other.height) / 2 - abs(self.v - other.v)
        wide, tall = min(wide, self.width, other.width), min(tall, self.height, other.height)
        if wide <= 0 or tall <= 0:
            return 0.0
        union = self.width * self.height + other.width * other.height - wide * tall
        return wide * tall / union


def persons(mask: Maps, maps: Maps, width: int, height: int, n_m: float) -> Segmented:
    """Returns all persons in an image of this size. mask: (2 rows, 2 columns); maps: (22, rows,
    columns)."""
    shown = cv2.resize(mask, (width, height), interpolation=cv2.INTER_LINEAR)
    here = shown > MASK_LEVEL
    middles = suppress(find_centers(maps), n_m)
    owners = assign(maps, middles)
    owner_at = cv2.resize(owners, (width, height), interpolation=cv2.INTER_NEAREST)
    found = []
    for number, middle in enumerate(middles):
        person = here & (owner_at == number)
        if person.mean() >= LEAST_SHARE:
            points = find_keypoints(maps, owners == number, width, height)
            found.append(Instance(0, float(middle.score), person, True, points))
    rest = here & (owner_at < 0)
    if rest.mean() >= LEAST_SHARE:
        # Mask pixels without a center are kept too, because culling needs them.
        points = find_keypoints(maps, owners < 0, width, height)
        score = MIDDLE_LEVEL * float(shown[rest].mean())
        found.append(Instance(0, score, rest, True, points))
    return Segmented(width, height, tuple(sorted(found, key=lambda i: -i.score)))


def find_centers(maps: Maps) -> list[Middle]:
    """Returns the peaks of the first map, best first."""
    heat = maps[0]
    peak = (heat >= cv2.dilate(heat, np.ones((3, 3), np.uint8))) & (heat > MIDDLE_LEVEL)
    rows, columns = np.nonzero(peak)
    best = np.argsort(-heat[rows, columns], kind="stable")[:MOST_MIDDLES]
    unit = REACH_PX / CELL_PX
    return [
        Middle(
            float(u),
            float(v),
            float(np.exp(np.clip(maps[3, v, u], -4, 2)) * unit),
            float(np.exp(np.clip(maps[4, v, u], -4, 2)) * unit),
            float(np.clip(heat[v, u], 0, 1)),
        )
        for v, u in zip(rows[best], columns[best], strict=True)
    ]


def suppress(middles: list[Middle], n_m: float) -> list[Middle]:
    """Applies non-maximum suppression; input and output are best first."""
    kept: list[Middle] = []
    for middle in middles:
        if all(middle.overlap(better) <= n_m for better in kept):
            kept.append(middle)
    return kept


def assign(maps: Maps, middles: list[Middle]) -> NDArray[np.int16]:
    """Returns the index of the center that every cell votes for; -1 for none."""
    rows, columns = maps.shape[1:]
    if not middles:
        return np.full((rows, columns), -1, np.int16)
    v, u = np.mgrid[:rows, :columns]
    unit = REACH_PX / CELL_PX
    vote_u, vote_v = u + unit * maps[1], v + unit * maps[2]
    away = np.stack(
        [
            np.hypot(vote_u - m.u, vote_v - m.v) / np.sqrt(max(m.width * m.height, 4.0))
            for m in middles
        ]
    )
    owner: NDArray[np.int16] = away.argmin(axis=0).astype(np.int16)
    owner[away.min(axis=0) > FARTHEST_VOTE] = -1
    return owner


def find_keypoints(maps: Maps, owned: Mask, width: int, height: int) -> Keypoints:
    """Returns the best position of every joint near a person's cells; hidden and absent joints both
    have visibility 0."""
    near = cv2.dilate(owned.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    points = np.zeros((KEYPOINTS, 3), np.float32)
    rows, columns = owned.shape
    stretch = np.array([width / INPUT_WIDTH, height / INPUT_HEIGHT])
    for k in range(KEYPOINTS):
        heat = np.where(near, maps[5 + k], 0)
        v, u = divmod(int(heat.argmax()), columns)
        if heat[v, u] < KEYPOINT_LEVEL:
            continue
        top, left = max(0, v - 1), max(0, u - 1)
        window = heat[top : min(rows, v + 2), left : min(columns, u + 2)]
        y, x = np.mgrid[: window.shape[0], : window.shape[1]]
        weight = window / window.sum()
        cell = np.array([left + (weight * x).sum(), top + (weight * y).sum()])
        points[k, :2] = (CELL_PX * (cell + 0.5)) * stretch - 0.5
        points[k, 2] = 2
    return points
