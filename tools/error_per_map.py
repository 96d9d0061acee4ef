#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Prints the absolute trajectory error of each map of a run, aligned on its own.

    slambed run examples/orb_slam3/sequences_beside_ours.yaml
    .venv/bin/python tools/error_per_map.py results/sequences_beside_ours

A system that begins a new map after a track loss, as ORB-SLAM3 does, has several maps in one run.
Nothing ties them to each other unless it finds a known place again, so one alignment of all poses
says little. A map goes from one `initialized` event to the next. One camera has no scale: its maps
are aligned with one (Sim(3)).
"""

import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError
from slambed.metrics.accuracy import absolute_error
from slambed.report.load import Results, load

FEW = 3
"""A map with fewer poses cannot be aligned."""


def begins_of(results: Results, key: str) -> list[float]:
    """Returns the time stamps of the poses at which a map began."""
    events, path = results.table(key, "events"), results.trajectory(key)
    if events is None or path is None:
        return []
    times_s = events["seq_s"].ffill()
    tracked = events["type"].eq("frame_tracked") & events["state"].eq("ok")
    if not tracked.any():  # a system that reads a folder tells nothing of its frames
        return [float(path.stamps_s[0])]
    # Events count from the first frame, poses have the time stamps of the recording.
    offset_s = path.stamps_s[0] - times_s[tracked].iloc[0]
    began = times_s[events["type"].eq("initialized")].fillna(0.0)
    return [float(t) for t in began + offset_s]


def maps_of(path: Trajectory, begins_s: list[float]) -> Iterator[Trajectory]:
    """Yields the poses of each map."""
    half_a_frame = float(np.median(np.diff(path.stamps_s))) / 2
    for first, last in pairwise([*sorted(begins_s), np.inf]):
        own = (path.stamps_s >= first - half_a_frame) & (path.stamps_s < last - half_a_frame)
        yield Trajectory(path.stamps_s[own], path.positions_m[own], path.quaternions_xyzw[own])


def told(part: Trajectory, truth: Trajectory, with_scale: bool) -> str:
    """Returns `0.39 cm of 36 poses`."""
    if len(part) < FEW:
        return f"no error of {len(part)} poses"
    try:
        error = absolute_error(part, truth, with_scale=with_scale)
    except SlambedError:  # such as a camera that stood still
        return f"no error of {len(part)} poses"
    return f"{100 * error.rmse:.2f} cm of {len(part)} poses"


def main() -> int:
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        results = load(Path(sys.argv[1]))
    except SlambedError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    for run in results.valid_runs.itertuples():
        path, truth = results.trajectory(run.run_key), results.groundtruth(run.dataset)
        if path is None or truth is None:
            continue
        scaled = run.ate_alignment == "sim3"
        parts = [told(p, truth, scaled) for p in maps_of(path, begins_of(results, run.run_key))]
        print(f"{run.cell} #{run.repetition + 1}: {'; '.join(parts)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
