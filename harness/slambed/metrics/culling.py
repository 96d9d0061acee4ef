# SPDX-License-Identifier: Apache-2.0
"""Precision and recall of culling features on people, with masks of any age as they arrived. Judged
by the true labels of a generated sequence, which no node reads (docs/explanation/masks.md)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slambed.metrics.events import Event
from slambed.segment.instances import Mask
from slambed.segment.mask_cache import LABELS_FILE, LABELS_KEY, MaskCache

Pixels = NDArray[np.int64]


@dataclass(frozen=True)
class Culling:
    """Shares over all features of all frames; None if undefined."""

    recall: float | None = None
    precision: float | None = None


def culling_of(frames: list[Event], sequence: Path, border_px: int) -> Culling:
    """Evaluates `frame_features` events. A feature within the border around a person is culled
    correctly, but not missed if it is kept. Raises SlambedError if the labels cannot be read."""
    labels = MaskCache.open(sequence / LABELS_FILE, LABELS_KEY)
    on_people = found = culled = rightly = 0
    for event in frames:
        people = labels.frame(event["frame"]).moving()
        near = widened(people, border_px)
        out, kept = _pixels(event["culled"]), _pixels(event["kept"])
        caught = int(_inside(people, out).sum())
        found += caught
        on_people += caught + int(_inside(people, kept).sum())
        culled += len(out)
        rightly += int(_inside(near, out).sum())
    return Culling(
        recall=found / on_people if on_people else None,
        precision=rightly / culled if culled else None,
    )


def widened(mask: Mask, border_px: int) -> Mask:
    """Dilates the mask with a square, like the nodes do."""
    sums = np.pad(mask, border_px + 1).astype(np.int64).cumsum(axis=0).cumsum(axis=1)
    side = 2 * border_px + 1
    inside = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    rows, columns = mask.shape
    wide: Mask = inside[:rows, :columns] > 0
    return wide


def _pixels(text: str) -> Pixels:
    """Parses pairs of u, v."""
    return np.array(text.split(), dtype=np.int64).reshape(-1, 2)


def _inside(mask: Mask, pixels: Pixels) -> NDArray[np.bool_]:
    rows, columns = mask.shape
    u, v = pixels[:, 0], pixels[:, 1]
    shown = (u >= 0) & (u < columns) & (v >= 0) & (v < rows)
    covered: NDArray[np.bool_] = shown.copy()
    covered[shown] = mask[v[shown], u[shown]]
    return covered
