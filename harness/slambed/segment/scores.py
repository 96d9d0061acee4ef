# SPDX-License-Identifier: Apache-2.0
"""Scores masks and keypoints against the ground truth of a sequence."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from slambed.segment.instances import Instance, Segmented

LEAST_SHARE = 0.005
"""Images in which people cover less than this fraction do not count for the overlap."""
#: Bin edges of a person's size for recall, as fractions of the image.
SIZES = (0.0, 0.005, 0.02, 0.1, 1.0)
#: COCO's 2 * sigma of each keypoint (cocodataset.org, keypoint evaluation), per sqrt(area).
_SIGMAS = 2 * np.array(
    [
        0.026,
        0.025,
        0.025,
        0.035,
        0.035,
        0.079,
        0.079,
        0.072,
        0.072,
        0.062,
        0.062,
        0.107,
        0.107,
        0.087,
        0.087,
        0.089,
        0.089,
    ]
)


@dataclass
class Scores:
    """Scores accumulated over images."""

    overlaps: list[float] = field(default_factory=list)
    false_shares: list[float] = field(default_factory=list)
    """Masked fraction of each image without people."""
    similarities: list[float] = field(default_factory=list)
    hit_px: int = 0
    true_px: int = 0
    marked_px: int = 0
    by_size: dict[float, list[float]] = field(default_factory=dict)
    """Recall of every person, by the lower edge of its size bin."""

    def add(self, found: Segmented, truth: Segmented) -> None:
        """Adds one image."""
        marked, true = found.moving(), truth.moving()
        hit = int((marked & true).sum())
        self.hit_px += hit
        self.true_px += int(true.sum())
        self.marked_px += int(marked.sum())
        if not true.any():
            self.false_shares.append(float(marked.mean()))
        if true.mean() >= LEAST_SHARE:
            self.overlaps.append(hit / int((marked | true).sum()))
        for person in truth.instances:
            share = float(person.mask.mean())
            edge = max(low for low in SIZES[:-1] if low <= share)
            self.by_size.setdefault(edge, []).append(float(marked[person.mask].mean()))
            if share >= LEAST_SHARE and person.keypoints is not None:
                self.similarities += _similarity(found, person)

    def as_dict(self) -> dict[str, float | dict[str, float]]:
        """Returns means and ratios; those without data are left out."""
        found: dict[str, float | dict[str, float]] = {}
        if self.overlaps:
            found["iou_mean"] = _mean(self.overlaps)
        if self.true_px:
            found["recall"] = round(self.hit_px / self.true_px, 4)
        if self.marked_px:
            found["precision"] = round(self.hit_px / self.marked_px, 4)
        if self.similarities:
            found["oks_mean"] = _mean(self.similarities)
        if self.false_shares:
            found["marked_without_people"] = _mean(self.false_shares)
        found["recall_by_share"] = {
            f"from_{edge:g}": _mean(self.by_size[edge]) for edge in sorted(self.by_size)
        }
        return found


def keypoint_similarity(
    found: NDArray[np.float32], truth: NDArray[np.float32], area_px: float
) -> float:
    """Returns COCO's object keypoint similarity over the visible joints; a joint that was not found
    scores 0. NaN if none is visible."""
    seen = truth[:, 2] == 2
    if not seen.any():
        return float("nan")
    away = ((found[:, :2] - truth[:, :2]) ** 2).sum(axis=1)
    fit = np.exp(-away / (2 * area_px * _SIGMAS**2)) * (found[:, 2] > 0)
    return float(fit[seen].mean())


def _similarity(found: Segmented, person: Instance) -> list[float]:
    """Returns the similarity of the instance that overlaps a person most; empty if no joint is
    visible."""
    assert person.keypoints is not None
    best, similarity = 0.0, 0.0
    for candidate in found.instances:
        overlap = float((candidate.mask & person.mask).sum() / (candidate.mask | person.mask).sum())
        if candidate.keypoints is not None and overlap > best:
            area = float(person.mask.sum())
            best = overlap
            similarity = keypoint_similarity(candidate.keypoints, person.keypoints, area)
    if np.isnan(similarity) or not (person.keypoints[:, 2] == 2).any():
        return []
    return [similarity]


def _mean(values: list[float]) -> float:
    return round(float(np.mean(values)), 4)
