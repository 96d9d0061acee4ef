# SPDX-License-Identifier: Apache-2.0
"""The generated LTE-like uplink of CloudSLAM's experiments."""

import runpy

import numpy as np

from slambed.link.profile import load_profile
from slambed.native import repository_root

NAME = "traces/cloudslam_lte_like.up"


def test_it_has_the_printed_mean_and_range() -> None:
    """CloudSLAM (SEC 2020), Section VII-E1: 0 to 17.7 Mbit/s, mean 6.2."""
    times_ms = np.array(load_profile("cloudslam_lte_like").rate_traces[NAME])
    packets, _ = np.histogram(times_ms, np.arange(0, times_ms[-1] + 501, 500))
    mbps = packets * 1500 * 8 / 0.5 / 1e6
    assert abs(mbps.mean() - 6.2) < 0.1
    assert mbps.min() == 0
    assert 17 < mbps.max() <= 17.7 + 0.03  # one packet of tolerance per half second


def test_the_tool_makes_the_same_trace_again() -> None:
    tool = runpy.run_path(str(repository_root() / "tools/lte_like_trace.py"))
    file = repository_root() / "netem_profiles" / NAME
    assert tool["opportunities"]() == [int(line) for line in file.read_text().split()]
