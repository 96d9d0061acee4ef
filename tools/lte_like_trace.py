# SPDX-License-Identifier: Apache-2.0
"""The trace of the profile cloudslam_lte_like: made, not recorded.

    lte_like_trace.py > netem_profiles/traces/cloudslam_lte_like.up

CloudSLAM (SEC 2020, Section VII-E1) prints of its LTE uplink that it ranges from 0 to 17.7 Mbit/s
with a mean of 6.2. This is a seeded capacity with that range and mean: a half second's rate wanders
(its logarithm is an AR(1) process), and twice a minute, on average, nothing passes for one to two
seconds. How fast it wanders and how often it stops is our choice. Written as Mahimahi reads it: a
line is a millisecond in which one packet of 1,500 bytes may leave; after its last line the trace
begins again.
"""

import math
import random

SEED, SECONDS, STEP_MS = 1, 60, 500
MEAN_MBPS, MOST_MBPS = 6.2, 17.7
PACKET_BITS = 1500 * 8
KEEPS, SPREAD = 0.9, 0.55
"""Of the logarithm: what a step keeps of the one before, standard deviation."""
STOPS_PER_S = 2 / 60


def shape(rng: random.Random) -> list[float]:
    """Rate of every step, before it is scaled to the mean."""
    rates, state, stopped = [], 0.0, 0
    for _ in range(SECONDS * 1000 // STEP_MS):
        state = KEEPS * state + rng.gauss(0, SPREAD * math.sqrt(1 - KEEPS**2))
        if stopped == 0 and rng.random() < STOPS_PER_S * STEP_MS / 1000:
            stopped = rng.choice([2, 3, 4])
        rates.append(0.0 if stopped else math.exp(state))
        stopped = max(0, stopped - 1)
    return rates


def scaled(rates: list[float]) -> list[float]:
    """With the printed mean, cut off at the printed maximum: the factor is found by bisection."""
    low, high = 0.0, 1000.0
    for _ in range(60):
        factor = (low + high) / 2
        mean = sum(min(MOST_MBPS, factor * rate) for rate in rates) / len(rates)
        low, high = (factor, high) if mean < MEAN_MBPS else (low, factor)
    return [min(MOST_MBPS, low * rate) for rate in rates]


def opportunities() -> list[int]:
    """The milliseconds, each as often as packets may leave in it."""
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
