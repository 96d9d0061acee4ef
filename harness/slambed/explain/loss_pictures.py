# SPDX-License-Identifier: Apache-2.0
"""Draws the frames before and at a track loss, with their feature matches."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from slambed.data import places
from slambed.data.cache import SequenceCache
from slambed.data.camera_motion import CameraMotion
from slambed.data.difficulty import compare, features_of, match
from slambed.data.prepared import PreparedSequence
from slambed.explain.run_log import RunLog
from slambed.files.json_file import read_object
from slambed.metrics.collect import stored_log
from slambed.metrics.events import read_events
from slambed.metrics.losses import EVENTS, TrackLoss, losses_of
from slambed.report.style import save_picture

RIGHT, WRONG, UNKNOWN = "#009E73", "#D55E00", "#E69F00"
SIZE_IN = (13.0, 5.6)


def losses_in(run: RunLog) -> list[TrackLoss]:
    """Returns the losses of a run, from a result or a raw folder."""
    parquet = run.folder / "events.parquet"
    return losses_of(stored_log(parquet, EVENTS) if parquet.is_file() else read_events(run.folder))


def draw_loss(run: RunLog, loss: TrackLoss, path: Path) -> str:
    """Writes the figure of a loss; returns a line with its path, or why there is none."""
    if loss.frame is None or loss.last_frame is None:
        return "no pictures: the events do not name the frames"
    checksum = (read_object(run.folder / "manifest.json") or {}).get("sequence_checksum")
    sequence = SequenceCache(places.prepared_folder()).of_checksum(str(checksum))
    if sequence is None:
        return "no pictures: the sequence is not prepared here; 'slambed data prepare ID' makes it"
    save_picture(lambda: figure_of_loss(sequence, loss), path)
    return f"pictures on both sides of the loss: {path}"


def figure_of_loss(sequence: PreparedSequence, loss: TrackLoss) -> Figure:
    """Draws the last frame with a pose, the lost frame, and the matches of their descriptors."""
    assert loss.frame is not None and loss.last_frame is not None
    figure, axes = plt.subplots(figsize=SIZE_IN)
    info, frames = sequence.info, (loss.last_frame, loss.frame)
    axes.imshow(np.hstack([sequence.gray(frame) for frame in frames]), cmap="gray", aspect="equal")
    first, second = (features_of(sequence, frame) for frame in frames)
    judged = right = None
    truth = sequence.groundtruth()
    if truth is not None and truth.has_orientation:
        motion = CameraMotion.of(sequence)
        if all(motion.knows(frame) for frame in frames):
            pair = compare(sequence, motion, (frames[0], first), (frames[1], second))
            judged, right = pair.judged, pair.right
    matches = match(first, second)
    ends = np.stack([first.pixels[matches[:, 0]], second.pixels[matches[:, 1]]], axis=1)
    ends[:, 1, 0] += info.width
    kinds = (
        [("matches", UNKNOWN, np.ones(len(matches), np.bool_))]
        if judged is None or right is None
        else [
            ("right by ground truth", RIGHT, right),
            ("wrong", WRONG, judged & ~right),
            ("without depth", UNKNOWN, ~judged),
        ]
    )
    for name, color, chosen in kinds:
        _draw(axes, ends[chosen], f"{int(chosen.sum())} {name}", color)
    times_s = sequence.times_s
    apart_s = times_s[frames[1]] - times_s[frames[0]]
    axes.set_title(
        f"frame {frames[0]}, the last with a pose, and frame {frames[1]}, lost {apart_s:.2f} s "
        f"later ({len(first)} and {len(second)} features)",
        loc="left",
    )
    axes.set_axis_off()
    axes.legend(loc="lower left", framealpha=0.8)
    return figure


def _draw(axes: Axes, ends: np.ndarray, label: str, color: str) -> None:
    axes.add_collection(LineCollection(list(ends), colors=color, linewidths=0.7, alpha=0.8))
    points = ends.reshape(-1, 2)
    axes.plot(points[:, 0], points[:, 1], ".", color=color, markersize=3, label=label)
