# SPDX-License-Identifier: Apache-2.0
"""Error rates of the verdict rules, simulated with fixed seeds, and mutations that these checks
must detect."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from slambed.metrics.changes import newcombe
from slambed.metrics.comparison import holm
from slambed.papers.verdicts import contrasts, rates, shares, statements
from slambed.papers.verdicts.contrasts import (
    Ordering,
    Step,
    judge_blocks,
    judge_contrast,
    power_of,
)
from slambed.papers.verdicts.means import Effect, judge_mean
from slambed.papers.verdicts.model import LEVEL, Floats, Mean, Share
from slambed.papers.verdicts.prediction import score, share_position
from slambed.papers.verdicts.shares import chance_to_reproduce, judge_share
from slambed.papers.verdicts.statements import (
    Pair,
    judge_about,
    judge_bound,
    judge_range,
    judge_reduction,
    judge_reduction_bound,
    judge_set,
    judge_up_to,
    judge_up_to_more,
    judge_window,
    pair_by_seed,
)
from slambed.papers.verdicts.trends import cochran_armitage, jonckheere, page, shares_rising

MOST = 0.06


def check_off_by_the_margin() -> None:
    for paper in rates.PAPER_SHARES:
        for runs in (10, 30, 100, 300):
            assert rates.share_off(paper, runs) <= MOST, (paper, runs)


def check_reversed_truth() -> None:
    found = rates.one_contrast(0.5, 0.05, 30)
    assert found.get("holds", 0.0) == 0
    assert found["reversed"] >= 0.8


def check_maxima() -> None:
    """Three sequences whose gain exceeds the stated one by exactly the margin: tests Holm."""
    generator = np.random.default_rng(7)
    called = 0
    for _ in range(400):
        ours = {
            name: Pair(Mean.of(generator.normal(50, 3, 20)), Mean.of(generator.normal(90, 3, 20)))
            for name in ("desk", "pioneer2", "pioneer3")
        }
        called += judge_up_to_more(ours, 30.0, "pioneer2").why.startswith("more than stated")
    assert called / 400 <= MOST


def check_reversals() -> None:
    """Five pairs without any effect: none holds, so "reversed" is the possible error."""
    generator = np.random.default_rng(11)
    found = 0
    for bad in generator.binomial(100, 0.5, (400, 5, 2)):
        steps = [contrasts.Step((Share(a, 100), Share(b, 100)), (), "") for a, b in bad.tolist()]
        found += contrasts.judge_contrast(steps, float("nan")).outcome == "reversed"
    assert found / 400 <= MOST


def check_reduction() -> None:
    assert rates.reduction_same(0.942, 0.942, 20, 0.3) > 0.75
    pair = Pair(Mean(1000.0, 100.0, 30), Mean(58.0, 6.0, 30))
    assert judge_reduction(pair, 0.942, 0.001).outcome == "reproduced"


# (1) and (2)


def test_equal_shares_reproduce_with_enough_runs_and_rarely_differ() -> None:
    assert [rates.share_same(p, 100)[0] > 0.95 for p in (0.0, 0.03, 1.0)] == [True] * 3
    assert rates.share_same(0.36, 30)[0] < 0.01  # thirty runs are too few, as expected
    assert 0.4 < rates.share_same(0.36, 100)[0] < 0.5
    assert rates.share_same(0.36, 300)[0] > 0.7
    for paper in rates.PAPER_SHARES:
        for runs in (10, 30, 100):
            assert rates.share_same(paper, runs)[1] <= MOST


def test_shares_off_by_the_margin_are_not_reproduced() -> None:
    check_off_by_the_margin()


def test_means_equal_and_off_by_the_margin() -> None:
    assert rates.mean_same(1.0, 20, 20, 0.2, 0.2) > 0.7
    assert rates.mean_same(1.0, 100, 100, 0.2, 0.2) > 0.99
    for runs, paper_runs in ((10, 5), (20, 20), (100, 100)):
        for ratio in (1.2, 1 / 1.2):
            assert rates.mean_same(ratio, runs, paper_runs, 0.2, 0.2) <= MOST


def test_a_reduction_is_distinguished_from_one_at_its_margin() -> None:
    check_reduction()
    for true in (1 - 0.058 * 4 / 3, 1 - 0.058 * 3 / 4):
        assert rates.reduction_same(true, 0.942, 20, 0.3) <= MOST


# (3) and (4)


def test_no_effect_rarely_holds() -> None:
    for share in (0.02, 0.1, 0.3, 0.8):
        for runs in (10, 30, 100):
            assert rates.trend_rate((share,) * 5, runs) <= MOST
    assert rates.values_trend_rate((0.0,) * 4, 20) <= MOST
    assert rates.one_contrast(0.2, 0.2, 30).get("holds", 0) <= MOST


def test_a_conjunction_never_holds_by_chance() -> None:
    for runs in (10, 30, 100):
        same = rates.ENHANCED
        assert rates.conjunction_rate(same, same, runs) == 0
        assert rates.reversal_rate(same, same, runs) <= MOST
    check_reversals()


def test_reversed_truth_is_found_reversed() -> None:
    check_reversed_truth()
    assert rates.reversal_rate(rates.CONVENTIONAL, rates.ENHANCED, 30) >= 0.8


def test_the_papers_own_orderings_are_found_where_they_hold() -> None:
    assert rates.trend_rate(rates.ENHANCED, 10) > 0.99
    assert 0.4 < rates.trend_rate(rates.CONVENTIONAL, 10) < 0.6
    assert rates.conjunction_rate(rates.ENHANCED, rates.CONVENTIONAL, 30) > 0.9


# (5) and (6)


@pytest.mark.parametrize("runs", [1, 2, 3, 4])
def test_up_to_four_runs_decide_nothing(runs: int) -> None:
    for bad in range(runs + 1):
        for paper in (0, 50, 100):
            assert judge_share(Share(bad, runs), Share(paper, 100)).outcome == "inconclusive"
    far = Mean(9.0, 0.1, runs)
    assert judge_mean(far, Mean(1.0, 0.1, 100), 0.2).outcome == "inconclusive"
    assert judge_mean(Mean(1.0, 0.0, runs), Mean(1.0), 0.2).outcome == "inconclusive"
    assert judge_bound(far, "lt", 1.0).outcome == "inconclusive"
    assert judge_reduction(Pair(far, far), 0.5).outcome == "inconclusive"
    step = Step((Share(0, runs), Share(runs, runs)), (Share(0, 100), Share(73, 100)))
    assert judge_contrast([step], 0.0).outcome == "too_few_runs"


def test_more_runs_never_lower_the_power() -> None:
    """Integer counts cause a sawtooth, which stays below 6 points."""
    for paper in (0, 3, 36, 73, 100):
        chances = [chance_to_reproduce(Share(paper, 100), n) for n in (10, 30, 100, 300, 1000)]
        assert all(b >= a - MOST for a, b in pairwise(chances)), chances
    step = Step((), tuple(Share(round(100 * p), 100) for p in rates.CONVENTIONAL))
    powers = [power_of([step], [[n] * 5]) for n in (10, 30, 100, 300)]
    assert powers == sorted(powers)


# (9) and intervals


def test_intervals_at_the_ends() -> None:
    for runs in (5, 30, 100):
        for bad in (0, runs):
            for paper in (0, 100):
                low, high = newcombe(bad, runs, paper, 100, 0.95)
                assert -1 <= low <= high <= 1
    assert judge_share(Share(0, 100), Share(0, 100)).outcome == "reproduced"
    assert judge_share(Share(100, 100), Share(100, 100)).outcome == "reproduced"
    assert judge_share(Share(0, 100), Share(100, 100)).outcome == "differs"
    assert judge_share(Share(0, 10), Share(0, 100)).outcome == "inconclusive"
    assert judge_share(Share(0, 10), Share(0, 100)).runs_needed == 30


def test_statistics_agree_with_published_examples() -> None:
    """Newcombe (1998) table II; R's prop.trend.test(smokers, patients); Hollander and Wolfe (1999)
    table 6.6 with the variance for ties."""
    assert np.round(newcombe(56, 70, 48, 80, 0.95), 4) == pytest.approx([0.0524, 0.3339])
    assert np.round(newcombe(9, 10, 3, 10, 0.95), 4) == pytest.approx([0.1705, 0.8090])
    falling = cochran_armitage([70, 129, 90, 83], [82, 136, 93, 86])
    assert 2 * float(falling) == pytest.approx(0.004132, abs=1e-6)
    motivation = [
        np.array([40, 35, 38, 43, 44, 41.0]),
        np.array([38, 40, 47, 44, 40, 42.0]),
        np.array([48, 40, 45, 43, 46, 44.0]),
    ]
    assert jonckheere(motivation) == pytest.approx(0.0207, abs=1e-4)


def test_rare_losses_are_tested_exactly() -> None:
    """Two losses, both in the last of three cells of ten: 10 * 9 / (30 * 29) of all placements."""
    cells = [Share(0, 10), Share(0, 10), Share(2, 10)]
    assert shares_rising(cells) == pytest.approx(45 / 435)
    assert shares_rising(cells[::-1]) == 1.0
    assert shares_rising([Share(10, 10), Share(10, 10), Share(10, 10)]) == 1.0
    mirrored = [Share(8, 10), Share(10, 10), Share(10, 10)]
    assert shares_rising(mirrored) == pytest.approx(45 / 435)


# (11) statements


def seconds(value: float) -> Mean:
    return Mean(value, 0.05 * value, 20)


def test_sets_and_ranges_are_no_lower_bounds() -> None:
    stated = [Mean(250.0), Mean(300.0)]
    assert judge_set([seconds(400), seconds(400)], stated, 0.2).outcome == "differs"
    assert judge_set([seconds(255), seconds(290)], stated, 0.2).outcome == "reproduced"
    assert judge_set([seconds(255), None], stated, 0.2).outcome == "inconclusive"
    assert judge_set([None, None], stated, 0.2).outcome == "not_run"
    assert judge_range(seconds(24), 23, 25).outcome == "reproduced"
    assert judge_range(seconds(30), 23, 25).outcome == "differs"
    assert judge_range(seconds(25), 23, 25).outcome == "inconclusive"


def pair(reduction: float, runs: int = 30) -> Pair:
    return Pair(
        Mean(1000.0, 100.0, runs), Mean(1000 * (1 - reduction), 100 * (1 - reduction), runs)
    )


def test_up_to_is_no_upper_bound() -> None:
    ours = {"desk": pair(0.88), "pioneer2": pair(0.942), "pioneer3": pair(0.93)}
    assert judge_up_to(ours, 0.942, "pioneer2", 0.001).outcome == "reproduced"
    small = {name: pair(0.02) for name in ours}
    found = judge_up_to(small, 0.942, "pioneer2", 0.001)
    assert found.outcome == "differs"
    assert "smaller effect" in found.why
    half = judge_up_to({name: pair(0.5) for name in ours}, 0.942, "pioneer2", 0.001)
    assert half.why.startswith("a smaller effect, but one everywhere")
    more = judge_up_to(ours | {"desk": pair(0.97)}, 0.942, "pioneer2", 0.001)
    assert more.outcome == "differs"
    assert more.why.startswith("more than stated on desk")
    assert judge_up_to({"desk": pair(0.942)}, 0.942, "pioneer2").outcome == "not_run"


def gain(points: float) -> Pair:
    return Pair(Mean(62.0, 2.0, 20), Mean(62.0 + points, 2.0, 20))


def test_up_to_of_points_is_about_differences() -> None:
    """Coverage that rises by up to 30.1 points, from 56.5 to 86.6 %, is no reduction of it."""
    ours = {"desk": gain(11.0), "pioneer2": gain(30.1), "pioneer3": gain(20.0)}
    assert judge_up_to_more(ours, 30.1, "pioneer2", 0.1).outcome == "reproduced"
    small = judge_up_to_more({name: gain(8.0) for name in ours}, 30.1, "pioneer2", 0.1)
    assert small.outcome == "differs"
    assert small.why.startswith("a smaller effect, but one everywhere")
    none = judge_up_to_more(ours | {"pioneer2": gain(-1.0)}, 30.1, "pioneer2", 0.1)
    assert none.why.startswith("a smaller effect;")
    more = judge_up_to_more(ours | {"desk": gain(45.0)}, 30.1, "pioneer2", 0.1)
    assert more.outcome == "differs"
    assert more.why.startswith("more than stated on desk;")
    assert judge_up_to_more({"desk": gain(30.1)}, 30.1, "pioneer2").outcome == "not_run"
    assert judge_up_to_more({"a": Pair(Mean(1.0), Mean(1.0))}, 30.1, "a").outcome == "not_run"


def test_a_maximum_that_is_not_above_is_called_so_in_five_percent_of_campaigns() -> None:
    check_maxima()


def test_pairs_of_seeds_sharpen_a_reduction() -> None:
    generator = np.random.default_rng(1)
    before = generator.normal(100, 20, 30)
    after = 0.5 * before + generator.normal(0, 2, 30)
    paired = pair_by_seed(before.tolist(), after.tolist())
    apart = Pair(paired.before, paired.after)
    assert paired.left().se < 0.5 * apart.left().se
    assert judge_reduction(paired, 0.5).outcome == "reproduced"


def test_about_and_more_than() -> None:
    assert judge_about(seconds(24), Mean(22.0)).outcome == "reproduced"
    assert judge_about(seconds(33), Mean(22.0)).outcome == "differs"
    assert judge_bound(seconds(20), "lt", 22).outcome == "reproduced"
    assert judge_bound(seconds(22), "lt", 22).outcome == "inconclusive"
    assert judge_bound(seconds(30), "lt", 22).outcome == "differs"
    assert judge_bound(Share(2, 100), "lt", 0.1).outcome == "reproduced"


@pytest.mark.parametrize(("before", "after"), [(0.0, 5.0), (5.0, 0.0), (0.0, 0.0)])
def test_a_reduction_of_or_to_nothing_is_on_no_side_of_a_bound(before: float, after: float) -> None:
    ours = Pair(Mean(before, 0.0, 20), Mean(after, 0.0, 20))
    found = judge_reduction_bound(ours, "gt", 0.5)
    assert (found.outcome, found.why) == ("inconclusive", "a reduction of or to nothing")
    assert judge_reduction_bound(Pair(Mean.of([]), Mean.of([])), "gt", 0.5).outcome == "not_run"
    assert judge_reduction_bound(pair(0.9), "gt", 0.5).outcome == "reproduced"


def test_times_of_losses() -> None:
    assert judge_window(9, 10, 3 / 87).outcome == "reproduced"
    assert judge_window(1, 20, 3 / 87).outcome == "differs"
    assert judge_window(3, 9, 3 / 87).outcome == "inconclusive"
    assert judge_window(0, 0, 3 / 87).outcome == "not_run"
    assert judge_window(8, 10, 0.8).outcome != "reproduced"  # a window of nearly all the time


# orderings


def test_an_ordering_that_the_paper_does_not_show_is_not_judged() -> None:
    steps = [[Step((Share(0, 100), Share(9, 100)), (Share(9, 100), Share(10, 100)))],
             [Step((Share(0, 100), Share(9, 100)), (Share(9, 100), Share(40, 100)))]]  # fmt: skip
    shown = holm([contrasts.paper_shows(s)[0] for s in steps])
    found = [judge_contrast(s, p).outcome for s, p in zip(steps, shown, strict=True)]
    assert found == ["not_shown_by_paper", "holds"]


def test_what_is_not_shown_was_not_seen_or_had_too_few_runs() -> None:
    paper = tuple(Share(round(100 * p), 100) for p in rates.CONVENTIONAL)
    ours = tuple(Share(bad, 10) for bad in (1, 2, 1, 3, 2))
    found = judge_contrast([Step(ours, paper)], 0.0)
    assert found.outcome == "too_few_runs"
    assert found.power == pytest.approx(0.51, abs=0.03)
    assert found.runs_needed == 30
    enough = tuple(Share(bad, 30) for bad in (10, 10, 10, 10, 10))
    assert judge_contrast([Step(enough, paper)], 0.0).outcome == "not_seen"
    enhanced = tuple(Share(round(100 * p), 100) for p in rates.ENHANCED)
    none = judge_contrast([Step((Share(0, 10),) * 5, enhanced)], 0.0)
    assert (none.outcome, none.runs_needed) == ("not_seen", None)  # ten runs would have shown it
    assert none.power is not None and none.power > 0.99
    words = judge_contrast([Step(enough, ())], float("nan"))
    assert (words.outcome, words.power) == ("inconclusive", None)
    assert "the paper prints no numbers" in words.why


def test_the_word_hangs_on_the_chance_to_see_it() -> None:
    """It is the chance to see the printed effect, whatever ours is."""
    paper = (Share(10, 100), Share(40, 100))
    for runs in (5, 10, 20, 30, 50, 100):
        found = judge_contrast([Step((Share(1, runs), Share(1, runs)), paper)], 0.0)
        assert found.power is not None
        assert (found.outcome == "not_seen") == (found.power >= 0.9)
        if found.outcome == "too_few_runs":
            assert found.runs_needed is not None and found.runs_needed > runs


def test_a_chance_says_on_which_spread_it_rests() -> None:
    """The same printed means: runs that vary little would have shown their difference, an assumed
    spread of a fifth would not."""
    paper = (Mean(79.4, digit=0.1), Mean(72.4, digit=0.1))
    steady = np.linspace(0.97, 1.03, 20) * 55

    def judged(*ours: Floats) -> Ordering:
        return judge_contrast([Step(ours, paper[::-1])], 0.0)

    measured = judged(steady, steady)
    assert (measured.outcome, measured.power) == ("not_seen", 1.0)
    assert "in 100% of campaigns, by the spread of our runs (1.9 %)" in measured.chance
    same = np.full(20, 55.0)
    constant = judged(same, same)
    assert (constant.outcome, constant.power) == ("not_seen", 1.0)
    assert constant.chance.endswith("by the spread of our runs (0 %)")
    assert power_of([Step((same, same), paper)], [[20, 20]]) == 0.0, "the paper's numbers fall"
    nothing = np.zeros(20)  # no spread in percent of it
    assumed = judged(nothing, nothing)
    assert assumed.outcome == "too_few_runs" and assumed.power is not None and assumed.power < 0.5
    assert assumed.chance.endswith("% of campaigns, by an assumed spread of 20 %")
    step = Step((steady, steady), paper[::-1])
    both = judge_contrast([step, Step((nothing, nothing), paper[::-1])], 0.0)
    assert both.spread == "the spread of our runs (1.9 %), 20 % where they have none"
    shares = (Share(10, 100), Share(40, 100))
    assert judge_contrast([Step((Share(1, 50), Share(1, 50)), shares)], 0.0).spread == ""


def test_each_pair_of_a_claim_has_its_own_outcome() -> None:
    """The count is adjusted over the pairs (Holm); the statement that all hold is not."""
    paper = (Share(0, 100), Share(50, 100))
    good, even, bad = ((Share(a, 100), Share(b, 100)) for a, b in ((0, 50), (20, 20), (50, 0)))
    found = judge_contrast([Step(good, paper), Step(even, paper), Step(good, paper)], 0.0)
    assert [part.outcome for part in found.parts] == ["holds", "not_shown", "holds"]
    assert (found.outcome, found.decides) == ("not_seen", 1)
    found = judge_contrast([Step(good, paper), Step(bad, paper)], 0.0)
    assert [part.outcome for part in found.parts] == ["holds", "reversed"]
    assert max(part.p_value for part in found.parts) < 0.001
    assert found.outcome == "reversed"
    weak = (Share(1, 100), Share(7, 100))  # p 0.03 alone
    assert 0.02 < contrasts.rising(weak) <= 0.05
    found = judge_contrast([Step(weak, paper), Step(weak, paper)], 0.0)
    assert (found.outcome, {p.outcome for p in found.parts}) == ("holds", {"holds"})
    found = judge_contrast([Step(weak, paper), Step(weak, paper), Step(even, paper)], 0.0)
    assert {p.outcome for p in found.parts} == {"not_shown"}
    assert judge_contrast([Step(good, paper)], 0.0).parts == ()


def test_blocks_ask_for_one_order_on_all_sequences() -> None:
    paper = np.array([[1, 2, 3, 4.0], [2, 3, 4, 5], [1, 3, 4, 6], [1, 2, 4, 5]])
    assert page(paper) < 0.001
    assert judge_blocks(2 * paper, paper).outcome == "holds"
    assert judge_blocks(paper[:, ::-1], paper).outcome == "reversed"
    few_runs = np.full(paper.shape, 4.0)
    assert judge_blocks(2 * paper, paper, runs=few_runs).outcome == "too_few_runs"
    assert judge_blocks(2 * paper, paper, runs=few_runs + 1).outcome == "holds"
    mixed = paper.copy()
    mixed[::2] = mixed[::2, ::-1]
    assert judge_blocks(mixed, paper).outcome == "inconclusive"
    few, spread = np.full(paper.shape, 5.0), np.full(paper.shape, 0.1)
    seen = judge_blocks(mixed, paper, None, spread, few)
    assert (seen.outcome, seen.runs_needed) == ("not_seen", None)
    assert seen.chance.endswith("by the spread of our runs (10 %)")
    constant = judge_blocks(mixed, paper, None, 0 * spread, few)
    assert constant.power == 1.0 and constant.spread == "the spread of our runs (0 %)"
    wide = judge_blocks(mixed, paper, None, 10 * spread, few)
    assert wide.outcome == "too_few_runs" and wide.power is not None and wide.power < 0.9
    assert wide.runs_needed is not None and wide.runs_needed > 5
    unshown = judge_blocks(paper, mixed)
    assert unshown.outcome == "not_shown_by_paper"
    assert unshown.p_holds <= LEVEL < unshown.p_reversed, "what ours show is not hidden"
    assert np.isnan(judge_blocks(np.where(paper > 5, np.nan, paper), mixed).p_holds)
    gap = np.where(paper > 5, np.nan, paper)
    assert page(gap) == 1.0
    assert judge_blocks(paper, gap).outcome == "not_shown_by_paper"


# prediction


def test_predictions_cover_what_they_say() -> None:
    for runs in (30, 100, 300):
        assert 0.93 <= rates.prediction_cover_overall(runs) <= 0.98
    for share in (0.1, 0.36, 0.73):
        assert 0.93 <= rates.prediction_cover(share, 100) <= 0.98
    assert 0.93 <= rates.mean_prediction_cover(20, 20) <= 0.98
    off = [share_position(Share(10, 100), Share(60, 100))] * 9 + [0.5]
    found = score(off)
    assert (found.inside, found.cells) == (1, 10)
    assert found.p_value < 1e-6
    assert found.histogram[-1] == 9


# Mutations: each must make a check above fail, otherwise that check is useless.

Check = Callable[[], None]


def no_margin(*counts: Any) -> tuple[Any, Any]:
    low, high = newcombe(*counts[:4], 0.95)
    return (low < 0) & (high > 0), (low > 0) | (high < 0)


@pytest.mark.parametrize(
    ("target", "name", "mutant", "check"),
    [
        (shares, "decide", no_margin, check_off_by_the_margin),
        (contrasts, "rising", lambda cells: contrasts.pair_rising(cells[1], cells[0]),
         check_reversed_truth),
        (statements, "effect_of", lambda a, b, kind: Effect(
            float(np.log(b.value / a.value)), 0.02, 30), check_reduction),
        (contrasts, "holm", np.asarray, check_reversals),
        (statements, "holm", np.asarray, check_maxima),
    ],
    ids=["margin ignored", "sign of an ordering flipped", "sign of a reduction flipped",
         "Holm left out of reversals", "Holm left out of maxima"],
)  # fmt: skip
def test_mutations_are_noticed(
    target: Any, name: str, mutant: Any, check: Check, monkeypatch: pytest.MonkeyPatch
) -> None:
    check()
    monkeypatch.setattr(target, name, mutant)
    with pytest.raises(AssertionError):
        check()


def test_what_is_assumed_is_flagged() -> None:
    ours = Mean(36.0, 2.0, 100)
    found = judge_mean(ours, Mean(36.3, None, None, 0.1), 0.2)
    assert found.assumed == ("n = 5 in the paper", "spread in the paper as ours (6%)")
    assert judge_mean(ours, Mean(36.3, 2.0, 100, 0.1), 0.2).assumed == ()
    assert judge_mean(replace(ours, value=0.0), Mean(36.3), 0.2).outcome == "inconclusive"
