# SPDX-License-Identifier: Apache-2.0
"""What a link profile asks for, in words."""

import numpy as np

from slambed.link.curves import Times
from slambed.link.impairments import Side
from slambed.link.profile import Profile

STEP_S = 0.01
DEFAULT_SPAN_S = 30.0
"""Described range of a constant profile."""
ENDLESS_SPAN_S = 120.0
"""Described range of a profile that never settles."""


def length_s(profile: Profile) -> float:
    """Returns the length of the profile that a summary describes; of a constant profile and of one
    that never settles a usual length."""
    end = ENDLESS_SPAN_S if profile.duration is None else profile.duration
    return end or DEFAULT_SPAN_S


def summary_times(end_s: float) -> Times:
    """Returns the times in s at which a profile is summarized, its end included."""
    return np.append(np.arange(0.0, end_s, STEP_S), end_s)


def rtt_range_ms(profile: Profile) -> tuple[float, float]:
    """Returns the smallest and the largest RTT within the described length."""
    values = profile.rtt_series_ms(summary_times(length_s(profile)))
    return float(values.min()), float(values.max())


def rtt_words(profile: Profile) -> str:
    """Returns the RTT in ms, or its range, such as `0 to 85`."""
    low, high = rtt_range_ms(profile)
    return f"{low:g}" if low == high else f"{low:.4g} to {high:.4g}"


def impairments(side: Side) -> list[str]:
    """Returns rate with queue, jitter and loss of one direction; empty without any."""
    found = []
    if side.rate is not None:
        rate = f"rate {side.rate.trace or f'{side.rate.mbps:g} Mbit/s'}"
        queue = side.rate.queue_bytes
        found.append(rate if queue is None else f"{rate}, queue {queue:,} bytes")
    if side.jitter is not None:
        size = side.jitter.sd_ms or side.jitter.mean_ms
        found.append(f"{side.jitter.shape} jitter {size:g} ms")
    if side.loss is not None:
        found.append(f"loss {side.loss.mean():.3%}")
    return found


def outages(profile: Profile) -> list[str]:
    """Returns a line per outage of both directions."""
    what = "waits" if profile.gap_mode == "hold" else "is dropped"
    return [
        f"silence of {gap.length_s:g} s at {gap.start_s:g} s"
        f"{f', every {gap.every_s:g} s' if gap.every_s else ''}; traffic {what}"
        for gap in profile.gaps
    ]
