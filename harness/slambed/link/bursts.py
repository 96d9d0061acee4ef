# SPDX-License-Identifier: Apache-2.0
"""Loss bursts in time with the same random chain per seed as slambed-relay and slambed-sim
(systems/core/link/impairment.cpp, base/random.hpp). Tests in both languages check the same burst
times."""

import math

from slambed.link.impairments import GilbertElliott, Side

WORD = (1 << 64) - 1
GOLDEN_GAMMA = 0x9E3779B97F4A7C15
LOSS_STATE = 2
"""Purpose::kLossState: index of the random number stream within a direction."""


def _mix(x: int) -> int:
    x = (x + GOLDEN_GAMMA) & WORD
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & WORD
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & WORD
    return x ^ (x >> 31)


class _SplitMix64:
    def __init__(self, seed: int, direction: int) -> None:
        of_direction = _mix(seed & WORD) ^ (direction * 0xD1342543DE82EF95 & WORD)
        self._state = _mix(of_direction) ^ (LOSS_STATE * 0x2545F4914F6CDD1D & WORD)

    def uniform(self) -> float:
        word = _mix(self._state)
        self._state = (self._state + GOLDEN_GAMMA) & WORD
        return (word >> 11) * 2.0**-53


def all_or_none(side: Side) -> GilbertElliott | None:
    """Returns the time-based chain of a direction if its states lose either all packets or none;
    else None. Such a chain needs no random number per packet."""
    chain = side.loss.gilbert_elliott if side.loss is not None else None
    if chain is None or chain.good_s is None or {chain.loss_good, chain.loss_bad} - {0.0, 1.0}:
        return None
    return chain


class Bursts:
    """Decides whether packets of one direction are lost at a run time."""

    def __init__(self, chain: GilbertElliott, seed: int, direction: int) -> None:
        """`direction`: 0 up, 1 down."""
        assert chain.good_s is not None and chain.bad_s is not None
        self._chain = chain
        self._random = _SplitMix64(seed, direction)
        self._mean_ns = {False: chain.good_s * 1e9, True: chain.bad_s * 1e9}
        both = self._mean_ns[False] + self._mean_ns[True]
        self._bad = self._random.uniform() * both < self._mean_ns[True]
        self._turns_ns = self._lasts()

    def _lasts(self) -> float:
        return -self._mean_ns[self._bad] * math.log(1.0 - self._random.uniform())

    @property
    def turns_s(self) -> float:
        """Run time at which the current state ends."""
        return self._turns_ns / 1e9

    def lost_at(self, run_time_s: float) -> bool:
        """Returns whether packets are lost; calls must be in order of time. Before time 0 there
        are no bursts."""
        if run_time_s < 0:
            return self._chain.loss_good > 0
        while self._turns_ns <= run_time_s * 1e9:
            self._bad = not self._bad
            self._turns_ns += self._lasts()
        return (self._chain.loss_bad if self._bad else self._chain.loss_good) > 0
