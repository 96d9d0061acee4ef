# SPDX-License-Identifier: Apache-2.0
"""Loss and jitter in standard errors: correct samples pass, wrong ones are detected; and a short
test of the relay's real packets."""

import numpy as np
import pytest
from link_parts import needs_relay
from numpy.typing import NDArray

from slambed.link import statistics as s

PACKETS = 20_000


def extra(lost: NDArray[np.bool_]) -> s.Values:
    return np.where(lost, np.nan, 0.0)


def chain(to_bad: float, to_good: float) -> s.Values:
    draws = np.random.default_rng(1).random(PACKETS)
    bad, states = False, []
    for draw in draws:
        states.append(bad)
        bad = draw >= to_good if bad else draw < to_bad
    return extra(np.array(states))


def normal(sd_ms: float, correlation: float, mean_ms: float = 0.0) -> s.Values:
    fresh = np.random.default_rng(2).normal(0.0, sd_ms, PACKETS)
    values = [fresh[0]]
    for each in fresh[1:]:
        values.append(correlation * values[-1] + np.sqrt(1 - correlation**2) * each)
    return np.array(values) + mean_ms


def lomax(mean_ms: float) -> s.Values:
    tail = s.PARETO_TAIL
    return np.random.default_rng(3).pareto(tail, PACKETS) * mean_ms * (tail - 1)


def outside(figures: list[s.Figure]) -> set[str]:
    return {figure.name for figure in figures if abs(figure.sigmas) > s.LIMIT}


def test_samples_as_asked_are_within_the_limit() -> None:
    lost = np.random.default_rng(4).random(PACKETS) < s.SHARE
    assert outside(s.random_loss(extra(lost))) == set()
    assert outside(s.bursty_loss(chain(s.TO_BAD, s.TO_GOOD))) == set()
    for correlation in (0.0, s.CORRELATION):
        assert outside(s.normal_jitter(correlation)(normal(s.SD_MS, correlation))) == set()
    assert outside(s.pareto_jitter(lomax(s.PARETO_MEAN_MS))) == set()


def test_samples_that_are_not_as_asked_are_outside() -> None:
    lost = np.random.default_rng(4).random(PACKETS) < 1.3 * s.SHARE
    assert outside(s.random_loss(extra(lost))) == {"share lost"}
    # The same loss share with longer bursts.
    assert outside(s.bursty_loss(chain(s.TO_BAD / 2, s.TO_GOOD / 2))) == {"burst length"}
    plain = s.normal_jitter(0.0)
    assert outside(plain(normal(s.SD_MS, 0.2))) >= {"correlation"}
    assert outside(plain(normal(1.1 * s.SD_MS, 0.0))) == {"deviation ms"}
    assert outside(plain(normal(s.SD_MS, 0.0, mean_ms=0.1))) == {"mean ms"}
    assert outside(s.pareto_jitter(lomax(1.1 * s.PARETO_MEAN_MS))) == {"mean ms", "median ms"}


@pytest.mark.parametrize(
    ("held_up", "repeated", "good"),
    [(0, None, True), (2, None, True), (3, None, False), (0, True, True), (0, False, False)],
)
def test_a_case_needs_a_calm_host_and_equal_drops(
    held_up: int, repeated: bool | None, good: bool
) -> None:
    figure = s.Figure("x", asked=1.0, found=1.2, error=0.1)
    assert s.Found("case", 100, held_up, [figure], repeated).good is good
    beyond = s.Figure("x", asked=1.0, found=1.4, error=0.1)
    assert not s.Found("case", 100, held_up, [figure, beyond], repeated).good


@needs_relay
def test_the_relay_loses_what_is_asked_and_the_same_again() -> None:
    found = s.check(s.CASES[1], seconds=2.0, seed=1)
    assert found.packets == 2000
    assert found.good, found
