# SPDX-License-Identifier: Apache-2.0
"""Compiles a profile to the relay's input: tables of one-way delays in steps of 10 ms."""

import numpy as np

from slambed.link.direction import DirectionConfig, RateConfig
from slambed.link.impairments import LARGEST_QUEUE_BYTES, Bandwidth, Side
from slambed.link.profile import Profile
from slambed.link.traces import mean_rate_mbps

STEP_MS = 10.0
DEFAULT_QUEUE_S = 0.2
"""Depth of the queue before a rate that has no `queue_bytes`: the buffer of a typical router."""
LEAST_QUEUE_BYTES = 65_536


def delay_table_ms(profile: Profile, horizon_s: float) -> tuple[list[float], list[float]]:
    """Returns one-way delays (up, down) at 0, 10, 20 ... ms until the profile settles or the
    horizon."""
    tables = []
    for curve, share in (
        (profile.up_curve, profile.up_share),
        (profile.down_curve, profile.down_share),
    ):
        settled = curve.duration_s()
        end = horizon_s if settled is None else min(settled, horizon_s)
        count = int(np.ceil(end * 1e3 / STEP_MS)) + 1
        t = np.arange(count, dtype=np.float64) * (STEP_MS / 1e3)
        table = [round(float(value), 6) for value in share * curve.at(t)]
        if end == settled:
            # Rounding may put the last time just before a step, whose value would hold for ever.
            after = share * curve.at(np.array([count * STEP_MS / 1e3]))
            if (value := round(float(after[0]), 6)) != table[-1]:
                table.append(value)
        tables.append(table)
    return tables[0], tables[1]


def queue_bytes(rate: Bandwidth, profile: Profile) -> int:
    """Returns the size of the queue before the rate in bytes."""
    if rate.queue_bytes is not None:
        return rate.queue_bytes
    mbps = rate.mbps if rate.trace is None else mean_rate_mbps(profile.rate_traces[rate.trace])
    assert mbps is not None
    asked = int(mbps * 1e6 / 8 * DEFAULT_QUEUE_S)
    return min(max(LEAST_QUEUE_BYTES, asked), LARGEST_QUEUE_BYTES)


def direction_config(
    profile: Profile, side: Side, table_ms: list[float], horizon_s: float
) -> DirectionConfig:
    """Returns the configuration of one direction for slambed-relay."""
    asked: dict[str, object] = {}
    if side.jitter is not None:
        asked["jitter"] = side.jitter.relay_config()
    if side.loss is not None:
        asked["loss"] = side.loss.relay_config()
    if side.rate is not None:
        asked["rate"] = _rate_config(side.rate, profile)
    if profile.gaps:
        asked["gaps_s"] = [pair for gap in profile.gaps for pair in gap.within(horizon_s)]
        asked["gap_drops"] = int(profile.gap_mode == "drop")
    table_us = [round(value * 1e3, 3) for value in table_ms]
    return DirectionConfig.model_validate({"delay_us": table_us, **asked})


def _rate_config(rate: Bandwidth, profile: Profile) -> RateConfig:
    waiting = queue_bytes(rate, profile)
    if rate.trace is not None:
        return RateConfig(queue_bytes=waiting, opportunities_ms=profile.rate_traces[rate.trace])
    assert rate.mbps is not None
    return RateConfig(queue_bytes=waiting, bits_per_s=rate.mbps * 1e6)
