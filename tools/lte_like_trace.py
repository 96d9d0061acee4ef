# SPDX-License-Identifier: Apache-2.0
"""Generates the trace of the profile cloudslam_lte_like; it is not recorded.

    lte_like_trace.py > netem_profiles/traces/cloudslam_lte_like.up

CloudSLAM (SEC 2020, Section VII-E1) reports that its LTE uplink ranges from 0 to 17.7 Mbit/s with a
mean of 6.2. This trace is a seeded random capacity with that range and mean. The logarithm of the
rate is an AR(1) process with steps of half a second, and twice a minute, on average, nothing passes
for one to two seconds. We chose the parameters of both. The format is Mahimahi's: each line is a
millisecond in which one packet of 1,500 bytes may leave, and the trace repeats after its last line.
"""

import math
import random

SEED, SECONDS, STEP_MS = 1, 60, 500
MEAN_MBPS, MOST_MBPS = 6.2, 17.7
PACKET_BITS = 1500 * 8
KEEPS, SPREAD = 0.9, 0.55
"""Of the logarithm: AR(1) coefficient per step, and standard deviation."""
STOPS_PER_S = 2 / 60


def shape(rng: random.Random) -> list[float]:
    """Returns the rate of every step before scaling to the mean."""
    rates, state, stopped = [], 0.0, 0
    for _ in range(SECONDS * 1000 // STEP_MS):
        state = KEEPS * state + rng.gauss(0, SPREAD * math.sqrt(1 - KEEPS**2))
        if stopped == 0 and rng.random() < STOPS_PER_S * STEP_MS / 1000:
            stopped = rng.choice([2, 3, 4])
        rates.append(0.0 if stopped else math.exp(state))
        stopped = max(0, stopped - 1)
    return rates


def total(rates: list[float]) -> float:
    """Adds one rate after the other, as the trace was made; sum() of Python 3.12 does not."""
    added = 0.0
    for rate in rates:
        added += rate
    return added


def scaled(rates: list[float]) -> list[float]:
    """Scales rates to the reported mean, clipped at the reported maximum (factor by bisection)."""
    low, high = 0.0, 1000.0
    for _ in range(60):
        factor = (low + high) / 2
        mean = total([min(MOST_MBPS, factor * rate) for rate in rates]) / len(rates)
        low, high = (factor, high) if mean < MEAN_MBPS else (low, factor)
    return [min(MOST_MBPS, low * rate) for rate in rates]


def opportunities() -> list[int]:
    """Returns the milliseconds, each as often as a packet may leave in it."""
    lines, credit = [], 0.0
    for step, mbps in enumerate(scaled(shape(random.Random(SEED)))):
        for ms in range(step * STEP_MS, (step + 1) * STEP_MS):
            credit += mbps * 1000 / PACKET_BITS
            while credit >= 1:
                lines.append(ms + 1)
                credit -= 1
    return lines


if __name__ == "__main__":
    print("\n".join(map(str, opportunities())))
