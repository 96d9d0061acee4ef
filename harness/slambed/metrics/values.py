# SPDX-License-Identifier: Apache-2.0
"""Metrics that need more than one expression in the list of metrics."""

import hashlib

import numpy as np

from slambed.metrics.run_data import RunData
from slambed.metrics.stages import total_ms
from slambed.metrics.summary import Value
from slambed.metrics.tracking import mean_of, quantile_of


def frames_dropped(run: RunData) -> Value:
    """Returns frames dropped by the player. A system that reads a folder skips frames
    unobserved."""
    return run.tracking.frames_dropped if run.measured and not run.spec.reads_folder else None


def extract_ms(run: RunData) -> Value:
    """Returns the median time of feature extraction on the mobile node."""
    return quantile_of(run.log.stages("mobile", "extract"), "wall_ms", 0.5)


def stage_ms_mean(run: RunData, name: str) -> Value:
    """Returns the mean time of a stage on the mobile node."""
    return mean_of(run.log.stages("mobile", name), "wall_ms")


def update_delay_ms(run: RunData) -> Value:
    """Returns the median of T_Total."""
    total = total_ms(run.log)
    return float(np.quantile(total, 0.5)) if run.has_edge and len(total) else None


def link_stalls(run: RunData) -> Value:
    """Returns how often a channel stalled; None if no channel reports, as in systems with their
    own programs."""
    # A user's program may have events of this name with other fields.
    links = [link for link in run.log.of("link") if "event" in link]
    return sum(link["event"] == "stalled" for link in links) if links else None


def first_loop_s(run: RunData) -> Value:
    """Returns the run time of the first loop closure."""
    closed = run.log.of("loop_closed")
    return closed[0]["t_ns"] / 1e9 if closed else None


def data_rate_mbit_s(run: RunData) -> Value:
    """Returns the data rate of both directions together over playback."""
    up, down = run.bytes_moved["up"], run.bytes_moved["down"]
    if up is None or down is None or not run.end_s:
        return None
    return 8e-6 * (up + down) / run.end_s


def truth_digest(run: RunData) -> Value:
    """Returns a digest of the run's ground truth."""
    if run.truth_file is None:
        return None
    return hashlib.sha256(run.truth_file.read_bytes()).hexdigest()[:16]
