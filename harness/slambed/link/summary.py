# SPDX-License-Identifier: Apache-2.0
"""What a link profile asks for, in words."""

from collections.abc import Mapping

import numpy as np

from slambed.link.curves import Times
from slambed.link.impairments import Jitter, PacketLoss, Side
from slambed.link.profile import Profile
from slambed.link.traces import MAHIMAHI_PACKET_BITS, mean_rate_mbps

STEP_S = 0.01
DEFAULT_SPAN_S = 30.0
"""Described range of a constant profile."""
ENDLESS_SPAN_S = 120.0
"""Described range of a profile that never settles."""


def length_s(profile: Profile) -> float:
    """Returns the length of the profile that a summary describes; of a constant latency that of
    its recorded rates, else a usual length, and a usual one where it never settles."""
    if profile.duration is None:
        return ENDLESS_SPAN_S
    rates_s = max((times[-1] / 1e3 for times in profile.rate_traces.values()), default=0.0)
    return profile.duration or rates_s or DEFAULT_SPAN_S


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
        found.append(f"{side.jitter.shape} jitter {size:g} ms{_correlation(side.jitter)}")
    if side.loss is not None:
        found.append(f"loss {side.loss.mean():.3%}{_bursts(side.loss)}")
    return found


def _correlation(jitter: Jitter) -> str:
    if jitter.correlation_s is not None:
        return f", correlated over {jitter.correlation_s:g} s"
    return f", correlation {jitter.correlation:g}" if jitter.correlation else ""


def _bursts(loss: PacketLoss) -> str:
    """Returns how long a burst lasts on average; empty for independent losses."""
    chain = loss.gilbert_elliott
    if chain is None:
        return ""
    if chain.bad_s is not None:
        return f", in bursts of {chain.bad_s:g} s on average"
    return f", in bursts of {1 / chain.to_good:.3g} packets on average" if chain.to_good else ""


def recorded_rate(side: Side, traces: Mapping[str, list[int]]) -> str:
    """Returns mean and range of a rate that is played from a recording; empty of any other."""
    if side.rate is None or side.rate.trace is None:
        return ""
    times_ms = traces[side.rate.trace]
    told = f"recorded rate: mean {mean_rate_mbps(times_ms):.2f} Mbit/s"
    if whole := times_ms[-1] // 1000:
        # A packet at the end of a second is of that second.
        packets = np.maximum(np.asarray(times_ms, dtype=np.int64) - 1, 0) // 1000
        mbps = np.bincount(packets)[:whole] * MAHIMAHI_PACKET_BITS / 1e6
        told += f", in single seconds {mbps.min():.2f} to {mbps.max():.2f}"
    return f"{told}; begins again after {times_ms[-1] / 1e3:g} s"


def outages(profile: Profile) -> list[str]:
    """Returns a line per outage of both directions."""
    what = "waits" if profile.gap_mode == "hold" else "is dropped"
    return [
        f"silence of {gap.length_s:g} s at {gap.start_s:g} s"
        f"{f', every {gap.every_s:g} s' if gap.every_s else ''}; traffic {what}"
        for gap in profile.gaps
    ]
