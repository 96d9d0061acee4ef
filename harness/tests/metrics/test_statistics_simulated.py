# SPDX-License-Identifier: Apache-2.0
"""Intervals and tests reach their nominal levels in simulation; the methods they replaced did
not."""

import pytest
import simulated_statistics as simulated


@pytest.mark.parametrize("runs", [6, 10, 30])
@pytest.mark.parametrize("skew", [0.0, simulated.SKEW, 2 * simulated.SKEW])
def test_the_interval_of_a_median_holds_for_every_distribution(runs: int, skew: float) -> None:
    assert simulated.coverage(simulated.now, "median", runs, skew) >= 0.93


def test_three_runs_give_no_interval_of_a_median() -> None:
    """Therefore reports call it a range."""
    assert simulated.coverage(simulated.now, "median", 3) == pytest.approx(0.75, abs=0.05)


@pytest.mark.parametrize("runs", [3, 5, 10, 30])
def test_the_interval_of_a_mean_is_nominal_where_the_bootstraps_was_not(runs: int) -> None:
    count = simulated.MEANS
    assert simulated.coverage(simulated.now, "mean", runs, 0, count) == pytest.approx(
        0.95, abs=0.02
    )
    skewed = simulated.coverage(simulated.now, "mean", runs, simulated.SKEW, count)
    assert skewed >= 0.92
    assert simulated.coverage(simulated.students, "mean", runs, simulated.SKEW, count) < skewed
    assert simulated.coverage(simulated.before, "mean", runs, simulated.SKEW, 300) < skewed


@pytest.mark.parametrize("skew", [0.2, simulated.SKEW, 2 * simulated.SKEW])
@pytest.mark.parametrize(("runs", "paper_runs"), [(20, 20), (100, 20), (100, 100), (300, 100)])
def test_skewed_runs_off_by_the_margin_are_rarely_called_reproduced(
    skew: float, runs: int, paper_runs: int
) -> None:
    assert simulated.reproduced_off_by_margin(skew, runs, paper_runs, log=True) <= 0.06


def test_a_plain_t_interval_would_call_more_of_them_so() -> None:
    assert simulated.reproduced_off_by_margin(simulated.SKEW, 300, 100, log=False) > 0.06


def test_identical_nights_are_no_new_evidence() -> None:
    assert simulated.quiet_nights_with_alarm(copies_count=False) <= 0.05
    assert simulated.quiet_nights_with_alarm(copies_count=True) > 0.05


def test_six_virtual_runs_a_night_are_enough_for_what_every_seed_shows() -> None:
    assert simulated.nights_with_alarm(1.15) >= 0.9


def test_pairs_show_what_unpaired_runs_hide_and_no_more() -> None:
    assert simulated.experiments_with_difference(True, 1.0) <= 0.06
    assert simulated.experiments_with_difference(True, 1.2) >= 0.95
    assert simulated.experiments_with_difference(False, 1.2) < 0.2
