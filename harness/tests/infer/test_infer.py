# SPDX-License-Identifier: Apache-2.0
"""Likelihood, intervals, spread of points and search, against closed forms and a known truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import special, stats

from slambed.infer.design import Point, _value, printed_point, rounds_of, spread
from slambed.infer.inference import _back
from slambed.infer.inference_plan import Criterion, Form, OpenItem
from slambed.infer.mixture import (
    Counts,
    best_possible,
    drawn_log_likelihoods,
    log_likelihood,
    predict_mean,
    predict_share,
    weights_of,
)
from slambed.infer.search import FitResult, search
from slambed.infer.success import ComparedCell, judge
from slambed.papers.verdicts.model import Mean, Share

ALONE = np.ones(1)


def test_the_likelihood_is_the_closed_form_of_the_beta_binomial() -> None:
    ours = {"a": Share(3, 10), "b": Share(50, 50)}
    printed = {"a": Share(78, 100), "b": Share(98, 100)}
    expected = 0.0
    for name, share in printed.items():
        k, n = ours[name].bad + 0.5, ours[name].runs - ours[name].bad + 0.5
        expected += np.log(float(special.comb(share.runs, share.bad)))
        expected += special.betaln(share.bad + k, share.runs - share.bad + n)
        expected -= special.betaln(k, n)
    assert log_likelihood(ours, printed) == pytest.approx(expected, abs=1e-9)
    assert log_likelihood(ours, {"a": printed["a"]}) < log_likelihood(
        {"a": Share(8, 10)}, {"a": printed["a"]}
    )
    assert best_possible(printed, 100) > log_likelihood(ours, printed)


def test_a_share_is_predicted_as_simulation_does() -> None:
    generator = np.random.default_rng(1)
    ours, weights = [Share(12, 40), Share(30, 40)], np.array([0.7, 0.3])
    which = generator.choice(2, size=200_000, p=weights)
    rates = np.array([generator.beta(s.bad + 0.5, s.runs - s.bad + 0.5, len(which)) for s in ours])
    drawn = generator.binomial(100, rates[which, np.arange(len(which))])
    found = predict_share(ours, weights, Share(50, 100))
    assert found.expected == pytest.approx(drawn.mean(), abs=0.3)
    assert ((drawn >= found.low) & (drawn <= found.high)).mean() == pytest.approx(0.95, abs=0.015)
    assert found.position == pytest.approx(
        (drawn < 50).mean() + 0.5 * (drawn == 50).mean(), abs=0.005
    )
    ends = [predict_share(ours, weights, Share(int(x), 100)) for x in (found.low, found.high)]
    beyond = [
        predict_share(ours, weights, Share(int(x), 100)) for x in (found.low - 1, found.high + 1)
    ]
    assert all(e.inside for e in ends) and not any(e.inside for e in beyond)


@pytest.mark.parametrize(("bad", "runs"), [(0, 100), (100, 100), (0, 5), (7, 30)])
def test_one_point_predicts_the_quantiles_of_its_law(bad: int, runs: int) -> None:
    law = stats.betabinom(100, bad + 0.5, runs - bad + 0.5)
    found = predict_share([Share(bad, runs)], ALONE, Share(50, 100))
    # The mid-p ends and the plain quantiles differ by at most one count.
    assert abs(found.low - law.ppf(0.025)) <= 1 and abs(found.high - law.ppf(0.975)) <= 1


def test_a_mean_is_predicted_by_the_t_distribution() -> None:
    ours, printed = Mean(30.0, 2.0, 20), Mean(33.0, None, 100)
    spread_of = 2.0 * np.sqrt(1 / 20 + 1 / 100)
    low, high = stats.t.ppf([0.025, 0.975], 19, 30.0, spread_of)
    found = predict_mean([ours], ALONE, printed)
    assert found is not None
    assert (found.low, found.high) == (pytest.approx(low), pytest.approx(high))
    assert not found.inside and found.expected == 30.0
    both = predict_mean([ours, Mean(36.0, 2.0, 20)], np.array([0.5, 0.5]), printed)
    assert both is not None and both.inside and both.low < 30 and both.high > 36
    assert predict_mean([ours, Mean(36.0)], np.array([0.5, 0.5]), printed) is None


def test_weights_are_shares_of_the_likelihood() -> None:
    found = weights_of([-1000.0, -1000.0 - np.log(3)])
    assert found == pytest.approx([0.75, 0.25])


def test_what_a_point_may_still_become_spreads_as_its_runs_do() -> None:
    printed = {"a": Share(50, 100)}

    def drawn(share: Share) -> np.ndarray:
        generator = np.random.default_rng(3)
        return drawn_log_likelihoods({"a": share}, printed, 100, 500, generator)

    few, many, all_of_them = drawn(Share(1, 5)), drawn(Share(20, 100)), drawn(Share(20, 100))
    assert np.ptp(few) > 10 and np.ptp(many) == 0
    assert all_of_them[0] == pytest.approx(log_likelihood({"a": Share(20, 100)}, printed))


ITEMS = {
    "phase": OpenItem(says="", set="params.phase", range=[0.0, 5.0], printed=0.0),
    "scale": OpenItem(says="", set="params.scale", range=[0.0, 1.0], printed=0.0),
}
CHOICES = {
    "size": OpenItem(says="", set="params.size", range=[1, 4], printed=2),
    "codec": OpenItem(says="", set="params.codec", values=["binary", "text"], printed="text"),
}


def test_points_fill_the_space_each_once_the_same_every_time() -> None:
    points = spread(ITEMS, 40, 3)
    assert len(set(points)) == 40 and points == spread(ITEMS, 40, 3) != spread(ITEMS, 40, 4)
    assert points[0] == printed_point(ITEMS) == Point((("phase", 0.0), ("scale", 0.0)))
    values = np.array([[float(v) for v in p.named.values()] for p in points])
    counts = np.histogram2d(values[:, 0], values[:, 1], 4, [[0, 5], [0, 1]])[0]
    assert counts.min() >= 1 and counts.max() <= 5
    assert all(v == float(f"{v:.3g}") for v in values.ravel())


def test_a_space_of_few_points_is_taken_whole() -> None:
    mixed = spread(CHOICES, 100, 1)
    expected = {
        Point((("size", s), ("codec", c))) for s, c in product(range(1, 5), ("binary", "text"))
    }
    assert set(mixed) == expected and len(mixed) == 8
    assert all(isinstance(p.named["size"], int) for p in mixed)
    codecs = {"codec": CHOICES["codec"]}
    assert [p.named["codec"] for p in spread(codecs, 2, 1)] == ["text", "binary"]


def test_rounds_double_up_to_the_last() -> None:
    form = Form(points=9, first_runs=10, final_runs=65, predict_runs=5, budget_runs=1)
    assert rounds_of(form) == [10, 20, 40, 65]


@dataclass
class Truth:
    """A model whose losses are known functions of the open items; the paper's are those at
    `true`."""

    seed: int
    true: dict[str, float] = field(init=False)
    runs: dict[tuple[Point, str], np.ndarray] = field(default_factory=dict)
    asked: dict[Point, int] = field(default_factory=dict)

    CELLS = tuple(f"c{n}" for n in range(10))
    FITTED, HELD_OUT = CELLS[::2], CELLS[1::2]

    def __post_init__(self) -> None:
        generator = np.random.default_rng([self.seed, 1])
        self.true = {"phase": generator.uniform(0, 5), "scale": generator.uniform(0, 1)}
        self.printed = {
            cell: Share(int(generator.binomial(100, self.rate(self.true, cell))), 100)
            for cell in self.CELLS
        }

    def rate(self, values: Mapping[str, object], cell: str) -> float:
        phase, scale, n = float(str(values["phase"])), float(str(values["scale"])), int(cell[1:])
        slope = 0.9 if n // 2 % 2 else -0.5
        return float(special.expit(0.5 * n - 2.5 + slope * (phase - 2.5) + 4 * (scale - 0.5)))

    def counts(
        self, points: Sequence[Point], runs: int, cells: Sequence[str]
    ) -> dict[Point, Counts]:
        found: dict[Point, Counts] = {}
        for point in points:
            for cell in cells:
                if (point, cell) not in self.runs:
                    place = [int(1000 * float(str(v))) for _, v in point.values]
                    generator = np.random.default_rng([self.seed, 2, int(cell[1:]), *place])
                    lost = generator.random(100) < self.rate(point.named, cell)
                    self.runs[point, cell] = np.cumsum(lost)
            found[point] = {c: Share(int(self.runs[point, c][runs - 1]), runs) for c in cells}
        return found

    def evaluate(self, points: Sequence[Point], runs: int) -> Mapping[Point, Counts]:
        for point in points:
            self.asked[point] = runs
        return self.counts(points, runs, self.FITTED)

    def fit(self, points: int = 48, first: int = 5, final: int = 50) -> FitResult:
        form = Form(
            points=points, first_runs=first, final_runs=final, predict_runs=5, budget_runs=1
        )
        printed = {c: self.printed[c] for c in self.FITTED}
        chosen = spread(ITEMS, points, self.seed)
        return search(chosen, rounds_of(form), printed, 2.0, self.evaluate)

    def predict(self, fit: FitResult) -> list[ComparedCell]:
        kept = [e.point for e in fit.kept]
        ours = self.counts(kept, 50, self.HELD_OUT)
        return [
            ComparedCell(
                c,
                self.printed[c],
                predict_share([ours[p][c] for p in kept], fit.weights, self.printed[c]),
                None,
            )
            for c in self.HELD_OUT
        ]


@pytest.fixture(scope="module")
def worlds() -> list[tuple[Truth, FitResult]]:
    found = []
    for seed in range(60):
        truth = Truth(seed)
        found.append((truth, truth.fit()))
    return found


def test_the_truth_is_recovered(worlds: list[tuple[Truth, FitResult]]) -> None:
    ends = {"phase": 5.0, "scale": 1.0}
    for name, end in ends.items():
        errors, by_chance = [], []
        for truth, fit in worlds:
            kept = [float(str(e.point.named[name])) for e in fit.kept]
            errors.append(abs(float(fit.weights @ kept) - truth.true[name]) / end)
            by_chance.append(abs(0.5 * end - truth.true[name]) / end)
        assert np.median(errors) < 0.5 * np.median(by_chance), name


def test_predictions_cover_what_they_say(worlds: list[tuple[Truth, FitResult]]) -> None:
    found = [b for truth, fit in worlds for b in truth.predict(fit)]
    inside = np.mean([b.prediction is not None and b.prediction.inside for b in found])
    assert len(found) == 300 and 0.93 <= inside <= 0.98


def test_predictions_of_another_world_do_not_cover(worlds: list[tuple[Truth, FitResult]]) -> None:
    """Numbers of another world are outside, so the intervals are informative."""
    found = []
    for (truth, fit), (other, _) in pairwise(worlds[:20]):
        for beside in truth.predict(fit):
            printed = other.printed[beside.cell]
            ours = truth.counts([e.point for e in fit.kept], 50, [beside.cell])
            counts = [ours[e.point][beside.cell] for e in fit.kept]
            found.append(predict_share(counts, fit.weights, printed).inside)
    assert np.mean(found) < 0.75


def test_every_kept_point_has_all_runs_and_bad_ones_have_few(
    worlds: list[tuple[Truth, FitResult]],
) -> None:
    for truth, fit in worlds[:20]:
        assert {e.runs for e in fit.kept} == {50}
        least = fit.best.log_likelihood - 2.0
        assert all(e.log_likelihood < least for e in fit.ranked if e not in fit.kept)
        assert len(fit.points) == 48
        assert sum(truth.asked.values()) < 0.6 * 48 * 50


def test_no_point_is_beyond_its_range() -> None:
    item = OpenItem(says="", set="params.x", range=[0.0, 0.1009], printed=0.0)
    assert _value(item, 0.999) == 0.1009 and _value(item, 0.99) == 0.1


def test_the_same_search_finds_the_same() -> None:
    first, second = Truth(3).fit(), Truth(3).fit()
    assert [e.point for e in first.ranked] == [e.point for e in second.ranked]


def test_a_search_without_budget_says_so() -> None:
    truth = Truth(1)
    printed = {c: truth.printed[c] for c in truth.FITTED}
    points = spread(ITEMS, 12, 1)
    fit = search(
        points, [5, 10], printed, 2.0, truth.evaluate, lambda own, runs: 12 if runs == 5 else 1
    )
    assert fit.unpaid > 0 and sum(e.runs == 10 for e in fit.points.values()) == 1


def test_what_an_item_buys_is_of_as_many_runs_as_the_likeliest_point_has() -> None:
    truth, best = Truth(1), printed_point(ITEMS).at("scale", 0.9)
    fit = FitResult({c: truth.printed[c] for c in truth.FITTED}, 2.0)
    fit.put(truth.evaluate([best], 5), 5)  # the budget ended before the final number of runs
    asked: list[int] = []

    def counts(stage: str, points: Any, cells: Any, runs: int) -> Mapping[Point, Counts]:
        asked.append(runs)
        return truth.evaluate(points, runs)

    plan = SimpleNamespace(open=ITEMS, fit=truth.FITTED)
    session: Any = SimpleNamespace(
        plan=plan, form=SimpleNamespace(final_runs=60), campaign=SimpleNamespace(counts=counts)
    )
    back, printed = _back(session, fit)
    assert asked == [5] and printed.runs == 5 and {b.evaluated.runs for b in back} == {5}


def compared_cell(
    cell: str, printed: int, expected: float, low: float, high: float
) -> ComparedCell:
    share = Share(printed, 100)
    made = predict_share([Share(50, 100)], ALONE, share)
    position = 0.5 if low <= printed <= high else 0.0
    made = type(made)(expected, low, high, position)
    return ComparedCell(cell, share, made, Share(round(expected), 100))


CELLS = [
    compared_cell("a", 10, 12, 5, 20),
    compared_cell("b", 50, 60, 55, 70),
    compared_cell("c", 90, 88, 80, 95),
]


@pytest.mark.parametrize(
    ("asked", "met", "why"),
    [
        ({"kind": "held_out_inside", "at_least": 0.6}, True, "2 of 3"),
        ({"kind": "held_out_inside", "at_least": 0.8}, False, "2 of 3"),
        ({"kind": "fitted_inside", "at_least": 1.0}, True, "0 of 0"),
        ({"kind": "mean_error", "at_most": 5.0}, True, "4.7 points"),
        ({"kind": "mean_error", "at_most": 4.0}, False, "4.7 points"),
        ({"kind": "rank", "at_least": 0.9, "cells": ["a", "b", "c"]}, True, "1.00"),
        ({"kind": "rank", "at_least": 0.9, "cells": ["b", "a", "c"]}, True, "1.00"),
        ({"kind": "rank", "at_least": 0.9, "cells": list("abcde")}, True, "0.90"),
        ({"kind": "rank", "at_least": 0.95, "cells": list("abcde")}, False, "0.90"),
        ({"kind": "rises", "cells": ["a", "b", "c"]}, True, "p "),
        ({"kind": "rises", "cells": ["b", "a"]}, False, "b to a"),
    ],
)
def test_success_is_what_the_plan_says(asked: dict[str, Any], met: bool, why: str) -> None:
    exchanged = [compared_cell("d", 95, 97, 0, 100), compared_cell("e", 99, 92, 0, 100)]
    cells = [*CELLS, *exchanged] if "d" in asked.get("cells", []) else CELLS
    found = judge(Criterion.model_validate({"says": "", **asked}), [], cells)
    assert found.met is met and why in found.why


def test_a_share_of_cells_is_not_missed_by_rounding() -> None:
    cells = [compared_cell(f"c{n}", 10, 12, 5, 20 if n < 11 else 9) for n in range(20)]
    asked = Criterion.model_validate({"says": "", "kind": "fitted_inside", "at_least": 0.55})
    assert judge(asked, cells, []).met
    asked = Criterion.model_validate({"says": "", "kind": "fitted_inside", "at_least": 0.6})
    assert not judge(asked, cells, []).met


def test_shares_of_different_numbers_of_runs_are_ranked_as_shares() -> None:
    cells = []
    for name, bad, runs in (("a", 3, 20), ("b", 20, 100), ("c", 12, 20)):
        made = replace(predict_share([Share(50, 100)], ALONE, Share(bad, runs)), expected=bad)
        cells.append(ComparedCell(name, Share(bad, runs), made, Share(bad, runs)))
    asked = Criterion.model_validate(
        {"says": "", "kind": "rank", "at_least": 0.9, "cells": ["a", "b", "c"]}
    )
    assert judge(asked, [], cells).why.startswith("rank correlation 1.00")


def test_what_was_not_run_is_no_success() -> None:
    gone = [*CELLS, ComparedCell("d", Share(0, 100), None, None)]
    for asked in (
        {"kind": "held_out_inside", "at_least": 0.6},
        {"kind": "mean_error", "at_most": 90.0},
        {"kind": "rank", "at_least": -1.0, "cells": ["a", "b", "d"]},
        {"kind": "rises", "cells": ["a", "d"]},
    ):
        found = judge(Criterion.model_validate({"says": "", **asked}), [], gone)
        assert not found.met, found
