# SPDX-License-Identifier: Apache-2.0
"""Differences of B and A: published examples, extremes, failed runs."""

import numpy as np
import pytest
import simulated_statistics as simulated
from numpy.typing import NDArray

from slambed.metrics.changes import paired_share_change, paired_shift, share_change, shift
from slambed.metrics.comparison import signed_rank

Floats = NDArray[np.float64]


def pairs(both: int, only_b: int, only_a: int, neither: int) -> tuple[Floats, Floats]:
    a = np.repeat([1.0, 0.0, 1.0, 0.0], [both, only_b, only_a, neither])
    b = np.repeat([1.0, 1.0, 0.0, 0.0], [both, only_b, only_a, neither])
    return a, b


def test_the_shift_of_a_textbook() -> None:
    """Permeability of membranes: Hollander and Wolfe, examples 4.1 to 4.3."""
    term = [0.80, 0.83, 1.89, 1.04, 1.45, 1.38, 1.91, 1.64, 0.73, 1.46]
    change = shift(term, [1.15, 0.88, 0.90, 0.74, 1.21])
    assert (change.value, change.low, change.high) == pytest.approx((-0.305, -0.76, 0.15))
    assert change.count == 5 and not change.is_range


def test_the_paired_shift_of_a_textbook() -> None:
    """Depression before and after therapy: Hollander and Wolfe, examples 3.1 to 3.4."""
    before = np.array([1.83, 0.50, 1.62, 2.48, 1.68, 1.88, 1.55, 3.06, 1.30])
    after = np.array([0.878, 0.647, 0.598, 2.05, 1.06, 1.29, 1.06, 3.14, 1.29])
    change = paired_shift(before, after)
    assert (change.value, change.low, change.high) == pytest.approx((-0.46, -0.786, -0.010))
    assert change.count == 9 and not change.is_range


@pytest.mark.parametrize("pairs_of_runs", [5, 6, 10, 17, 40])
def test_an_interval_has_no_zero_where_its_test_rejects(pairs_of_runs: int) -> None:
    random = np.random.default_rng(3)
    rejected = 0
    for _ in range(200):
        a = random.normal(size=pairs_of_runs)
        b = a + random.normal(0.5, 1.0, size=pairs_of_runs)
        change = paired_shift(a, b)
        without_zero = not change.is_range and not change.low <= 0 <= change.high
        p_value = signed_rank(a, b)
        if abs(p_value - 0.05) > 0.004:  # the normal distribution of many pairs is not exact
            assert without_zero == (p_value < 0.05), (p_value, change)
        rejected += without_zero
    assert rejected == 0 if pairs_of_runs < 6 else rejected > 10


def test_three_runs_against_three_give_a_range() -> None:
    change = shift([1.0, 2.0, 3.0], [2.0, 4.0, 8.0])
    assert change.is_range and (change.low, change.high) == (-1.0, 7.0)
    assert not shift(range(4), range(4)).is_range


def test_failed_runs_are_infinitely_worse_and_no_worse_than_one_another() -> None:
    failed = np.full(8, np.inf)
    assert shift(failed, failed).value == 0 == paired_shift(failed, failed).high
    assert shift(np.arange(8.0), failed).low == np.inf
    assert paired_shift(failed, np.arange(8.0)).high == -np.inf
    one_each = paired_shift(np.array([np.inf, 1.0]), np.array([1.0, np.inf]))
    assert (one_each.value, one_each.low, one_each.high) == (0.0, -np.inf, np.inf)


def test_the_paired_shares_of_the_method_s_paper() -> None:
    """Newcombe 1998 (paired), table II, method 10."""
    change = paired_share_change(*pairs(36, 12, 2, 0))
    assert (change.value, change.low, change.high) == pytest.approx((0.2, 0.0569, 0.3404), abs=1e-4)
    change = share_change(np.repeat([1.0, 0.0], [48, 32]), np.repeat([1.0, 0.0], [56, 14]))
    assert (change.low, change.high) == pytest.approx((0.0524, 0.3339), abs=1e-4)


def test_shares_at_their_ends_have_intervals_too() -> None:
    nothing, everything = np.zeros(10), np.ones(10)
    for change in (share_change, paired_share_change):
        same = change(nothing, nothing)
        assert same.value == 0 and -0.4 < same.low < 0 < same.high < 0.4
        all_of_them = change(nothing, everything)
        assert 0.5 < all_of_them.low < all_of_them.high == 1.0


@pytest.mark.parametrize("runs", [4, 6, 10, 30])
def test_the_interval_of_a_shift_keeps_its_promise(runs: int) -> None:
    assert simulated.coverage_of_shift(shift, runs) >= 0.935


@pytest.mark.parametrize(("a", "b"), [(0.1, 0.1), (0.3, 0.1), (0.8, 0.5)])
def test_the_intervals_of_shares_keep_theirs(a: float, b: float) -> None:
    """On average over the numbers of runs: shares of few runs are discrete."""
    counts = (10, 20, 30, 60)
    unpaired = [simulated.coverage_of_share(share_change, n, a, b) for n in counts]
    paired = [simulated.coverage_of_share(paired_share_change, n, a, b, 0.8) for n in counts]
    assert np.mean(unpaired) >= 0.93 and np.mean(paired) >= 0.93
    assert min(*unpaired, *paired) >= 0.91


def test_the_bootstrap_did_not() -> None:
    assert simulated.coverage_of_share(simulated.resampled_share, 6, 0.3, 0.1) < 0.85
