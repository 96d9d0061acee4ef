# SPDX-License-Identifier: Apache-2.0
"""A statement of no effect holds if every two cells are equal within the margin, and only then."""

import numpy as np
import pytest

from slambed.papers.verdicts.contrasts import Ordering, Step
from slambed.papers.verdicts.flat import judge_flat
from slambed.papers.verdicts.model import LEVEL, Floats, Share

MARGIN = 0.2


def judged(*chains: list[Floats]) -> Ordering:
    return judge_flat([Step(tuple(chain), ()) for chain in chains], MARGIN)


def around(value: float, runs: int = 5, cv: float = 0.01) -> Floats:
    """Returns runs with exactly this mean and this coefficient of variation."""
    steps = np.linspace(-1, 1, runs)
    return value * (1 + cv * steps / steps.std(ddof=1))


def test_equal_cells_hold() -> None:
    found = judged([around(1.0), around(1.02), around(0.97), around(1.01)])
    assert found.outcome == "holds"
    assert found.why.startswith("the farthest two differ by a factor of 1.05, every two by less")


def test_one_cell_apart_is_no_flat_curve() -> None:
    found = judged([around(1.0), around(1.02), around(1.5), around(1.01)])
    assert found.outcome == "reversed"
    assert "two points differ by a factor of 1.50, by more than 1.2" in found.why


@pytest.mark.parametrize("second", [1.19, 1.21])
def test_a_difference_near_the_margin_is_left_open(second: float) -> None:
    assert judged([around(1.0, cv=0.05), around(second, cv=0.05)]).outcome == "inconclusive"


def test_no_difference_found_is_not_enough() -> None:
    """Runs that scatter by half their mean have equal means here, and show nothing."""
    found = judged([around(1.0, cv=0.5), around(1.0, cv=0.5)])
    assert found.outcome == "inconclusive"
    assert "neither surely less nor surely more than 1.2" in found.why


def test_each_curve_has_an_outcome() -> None:
    flat, steep = [around(1.0), around(1.0)], [around(1.0), around(2.0)]
    found = judged(flat, steep)
    assert (found.outcome, found.decides) == ("reversed", 1)
    assert [part.outcome for part in found.parts] == ["holds", "reversed"]
    assert max(part.p_value for part in found.parts) <= LEVEL  # each is that of its outcome
    both = judged(flat, [around(7.0), around(7.0)])
    assert both.outcome == "holds"  # curves at different heights
    assert [part.outcome for part in both.parts] == ["holds", "holds"]


def test_runs_without_any_spread_are_certain() -> None:
    assert judged([np.full(5, 1.0), np.full(5, 1.19)]).outcome == "holds"
    assert judged([np.full(5, 1.0), np.full(5, 1.21)]).outcome == "reversed"


def test_what_has_no_ratio_is_not_judged() -> None:
    assert judged([around(1.0, 4), around(1.0)]).outcome == "too_few_runs"
    assert judged([np.zeros(5), around(1.0)]).outcome == "inconclusive"
    with pytest.raises(ValueError, match="no ratio"):
        judge_flat([Step((Share(0, 10), Share(0, 10)), ())], MARGIN)


def rate(outcome: str, means: list[float], cv: float = 0.05, runs: int = 5) -> float:
    generator = np.random.default_rng(7)
    draws = 400
    found = [
        judged([generator.normal(mean, cv * mean, runs) for mean in means]).outcome
        for _ in range(draws)
    ]
    return found.count(outcome) / draws


def test_how_often_the_rule_errs() -> None:
    at_the_margin = [1.0, 1.0, 1.0, 1.2]
    assert rate("holds", at_the_margin) <= 0.06
    assert rate("reversed", at_the_margin) <= 0.06
    assert rate("reversed", [1.0] * 4) == 0
    assert rate("holds", [1.0] * 4) >= 0.9
    assert rate("reversed", [1.0, 1.0, 1.0, 1.5]) >= 0.9
