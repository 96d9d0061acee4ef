# SPDX-License-Identifier: Apache-2.0
"""Intervals, tests, modes and power compared with published values and simulations."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from slambed.errors import SlambedError
from slambed.metrics.catalog import metric
from slambed.metrics.comparison import (
    fisher,
    holm,
    least_p,
    mann_whitney,
    mcnemar,
    power_hint,
    power_of_shares,
    runs_to_show,
    signed_rank,
    two_modes,
)
from slambed.metrics.robust_accuracy import coverage_aware_ate
from slambed.metrics.statistics import finite, interval, wilson
from slambed.regression.nights import worsening_p
from slambed.report.tables import with_interval


@pytest.mark.parametrize(
    ("bad", "runs", "low", "high"),
    [(0, 10, 0.0, 0.28), (4, 10, 0.17, 0.69), (0, 30, 0.0, 0.11), (30, 30, 0.89, 1.0)],
)
def test_wilson_intervals(bad: int, runs: int, low: float, high: float) -> None:
    found = wilson(bad, runs)
    assert (round(found.low, 2), round(found.high, 2)) == (low, high)
    oracle = stats.binomtest(bad, runs).proportion_ci(method="wilson")
    assert found.low == pytest.approx(oracle.low, abs=1e-12)
    assert found.high == pytest.approx(oracle.high, abs=1e-12)


def test_no_trials_is_no_share() -> None:
    with pytest.raises(SlambedError):
        wilson(0, 0)


def test_a_median_between_two_counts_keeps_its_half() -> None:
    counts = metric("track_losses")
    assert with_interval(counts, interval([0, 0, 1, 1])) == "0.5 (0 to 1)"
    assert with_interval(counts, interval([0, 1, 1])) == "1 (0 to 1)"
    assert counts.show(float(np.mean([1, 2, 2]))) == "1.7"
    assert counts.show(3 * 0.1 / 0.3) == "1"  # not quite whole, by rounding alone
    assert metric("lost").show(0.125) == "12"  # a share in percent has no digit of its own


def test_a_median_lies_between_order_statistics() -> None:
    few = interval([3.0, 1.0, 2.0, 5.0, 4.0])
    assert (few.value, few.low, few.high, few.is_range) == (3.0, 1.0, 5.0, True)
    six = interval([3.0, 1.0, 2.0, 5.0, 4.0, 6.0])
    assert (six.value, six.low, six.high, six.is_range) == (3.5, 1.0, 6.0, False)
    # Conover (1999): the third smallest and the third largest of 12 values.
    twelve = interval(np.arange(12.0))
    assert (twelve.low, twelve.high) == (2.0, 9.0)
    assert twelve.scaled(100).high == 900.0
    assert interval([7.0]).is_range


def test_failed_runs_stay_infinitely_bad() -> None:
    found = interval([1.0, 2.0, 3.0, np.inf, np.inf, np.inf, 2.0])
    assert (found.value, found.low, found.high) == (3.0, 1.0, np.inf)


def test_null_is_not_zero() -> None:
    assert finite([1.0, None, float("nan"), 2.0]).tolist() == [1.0, 2.0]
    # A history has columns of integers in which some are missing.
    assert finite(pd.array([1, None, 2], dtype="Int64")).tolist() == [1.0, 2.0]
    with pytest.raises(SlambedError):
        interval([None, None])


def test_tests_of_pairs_and_what_they_can_show() -> None:
    a = np.array([1.0, 5.0, 9.0, 20.0, 30.0, 70.0])
    assert signed_rank(a, a) == 1.0
    assert signed_rank(a, a + np.arange(1, 7)) == pytest.approx(2 / 2**6) == least_p(6, True)
    assert signed_rank(a, a + 1, "greater") == pytest.approx(1 / 2**6)
    bad = np.array([True] * 5 + [False])
    assert mcnemar(bad, bad) == 1.0
    assert mcnemar(bad & False, bad) == pytest.approx(2 / 2**5)
    assert mcnemar(bad & False, bad, "greater") == pytest.approx(1 / 2**5)
    assert least_p(4, False) == pytest.approx(mann_whitney(range(4), range(4, 8)).p_value)
    assert least_p(5, False) == pytest.approx(fisher(0, 5, 5, 5))
    assert (runs_to_show(1, True), runs_to_show(24, True), runs_to_show(24, False)) == (6, 10, 7)


def test_mann_whitney_and_its_effect_size() -> None:
    low, high = [1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0]
    test = mann_whitney(low, high, "greater")
    assert test.cliffs_delta == 1.0
    assert test.size == "large"
    assert test.p_value == pytest.approx(1 / 70)
    assert mann_whitney(low, low).cliffs_delta == 0.0
    assert mann_whitney([1.0, 2.0], [np.inf, np.inf], "greater").cliffs_delta == 1.0


def test_ties_among_few_runs_give_no_p_below_the_smallest_possible() -> None:
    for runs in range(2, 6):
        assert mann_whitney([0] * runs, [1] * runs).p_value == pytest.approx(least_p(runs, False))
    a, b = np.array([[0.0, 0, 0], [1, 2, 2]]), np.array([[1.0, 1, 1], [1, 2, 2]])
    assert worsening_p(a, b, "lower")[0] == pytest.approx(1 / 20)
    assert worsening_p(a, b, "lower")[1] > 0.5


def test_fisher_asks_whether_the_second_is_larger() -> None:
    assert fisher(1, 30, 11, 30, "greater") < 0.01 < 0.9 < fisher(11, 30, 1, 30, "greater")


def test_holm_keeps_order_and_bounds() -> None:
    assert holm([0.01, 0.04, 0.03]).tolist() == pytest.approx([0.03, 0.06, 0.06])


def test_thirty_runs_distinguish_3_from_36_percent() -> None:
    assert power_of_shares(0.03, 0.36, 30) > 0.8
    assert power_of_shares(0.03, 0.36, 10) < 0.5
    hint = power_hint(30)
    assert "30 unpaired runs a side distinguishes 3% of runs with a track loss from" in hint
    assert "nothing" in power_hint(1)


def test_power_agrees_with_simulation() -> None:
    rng = np.random.default_rng(7)
    a, b = rng.binomial(20, 0.1, 2000), rng.binomial(20, 0.5, 2000)
    reported = {
        pair: fisher(pair[0], 20, pair[1], 20) <= 0.05 for pair in set(zip(a, b, strict=True))
    }
    share = np.mean([reported[pair] for pair in zip(a, b, strict=True)])
    assert share == pytest.approx(power_of_shares(0.1, 0.5, 20), abs=0.035)


@pytest.mark.parametrize("runs", [8, 12, 30, 100])
def test_two_modes_seldom_seen_in_one_group(runs: int) -> None:
    rng = np.random.default_rng(runs)
    seen = sum(two_modes(rng.normal(10, 1, runs)) is not None for _ in range(1000))
    assert seen <= 40


def test_two_groups_are_reported() -> None:
    rng = np.random.default_rng(4)
    values = np.concatenate([rng.normal(1.5, 0.1, 14), rng.normal(6.0, 0.8, 6)])
    modes = two_modes(values)
    assert modes is not None
    assert (modes.low_count, modes.high_count) == (14, 6)
    assert two_modes([1.0] * 20) is None
    assert two_modes([1.0, 9.0]) is None


def test_failures_count_beside_the_survivors_accuracy() -> None:
    """Six good runs and four failures: the survivors look good, all runs together do not."""
    ate = [0.01] * 6 + [0.012, None, None, 0.5]
    coverage = [1.0] * 6 + [0.3, 0.0, 0.1, 0.99]
    found = coverage_aware_ate(ate, coverage, least_coverage=0.9)
    assert (found.survivors, found.runs) == (7, 10)
    assert found.survivor_median_m == pytest.approx(0.01)
    assert found.median_m == pytest.approx(0.01)
    worse = coverage_aware_ate(ate + [None] * 6, coverage + [0.2] * 6, least_coverage=0.9)
    assert worse.median_m is None
    assert worse.survivor_median_m == pytest.approx(0.01)
