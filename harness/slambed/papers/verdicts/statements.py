# SPDX-License-Identifier: Apache-2.0
"""Judges statements with a number: reductions, `up to`, `about`, more or less than, sets, ranges,
and times in a sequence. Each has its own rule; none is a bound that any small value meets."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import stats

from slambed.metrics.changes import wilson_limits
from slambed.metrics.comparison import holm
from slambed.papers.verdicts.means import Effect, effect_of, effects, judge_effect, judge_mean
from slambed.papers.verdicts.model import (
    FEWEST_RUNS,
    LEVEL,
    Mean,
    Scale,
    Share,
    Verdict,
    not_run,
    too_few,
)

REDUCTION_MARGIN = 1 / 3
"""Margin of what is left: 94.2 % less is reproduced by 92.3 to 95.7 % less."""
ABOUT_MARGIN = 0.25
MOSTLY = 0.5
"""`At about 22 s` means that most losses are there."""


@dataclass(frozen=True)
class Pair:
    """Two means of ours, before and after, with their `correlation` if the runs are paired by
    seed."""

    before: Mean
    after: Mean
    correlation: float = 0.0

    @property
    def fewest(self) -> int:
        """Returns the runs of the smaller side."""
        return min(self.before.count or 0, self.after.count or 0)

    @property
    def reduction(self) -> float:
        return 1 - self.after.value / self.before.value

    def left(self) -> Effect:
        """Returns ln(after / before) with its standard error (delta method)."""
        found = effect_of(self.after, self.before, "ratio")
        if not self.correlation or not self.before.cv or not self.after.cv:
            return found
        shared = 2 * self.correlation * self.before.cv * self.after.cv / self.fewest
        se = float(np.sqrt(max(found.se**2 - shared, 0.0)))
        return Effect(found.value, se, self.fewest - 1)


def pair_by_seed(before: Sequence[float], after: Sequence[float]) -> Pair:
    """Pairs runs in the same order of seeds, equally many on both sides."""
    first, second = np.asarray(before, dtype=np.float64), np.asarray(after, dtype=np.float64)
    constant = len(first) < 3 or first.std() == 0 or second.std() == 0
    shared = 0.0 if constant else float(np.corrcoef(first, second)[0, 1])
    return Pair(Mean.of(first), Mean.of(second), shared)


def judge_reduction(
    ours: Pair, stated: float, digit: float = 0.0, margin: float = REDUCTION_MARGIN
) -> Verdict:
    """Judges `x % less` (`stated` and `digit` are fractions): what is left is compared as a
    ratio."""
    if ours.fewest == 0:
        return not_run("no run")
    if ours.fewest < FEWEST_RUNS:
        return too_few(ours.fewest, "ratio", None)
    if not (ours.before.value > 0 and ours.after.value > 0 and stated < 1):
        return Verdict("inconclusive", "a reduction of or to nothing", scale="ratio")
    left = ours.left()
    printed = (digit / (1 - stated)) ** 2 / 12
    effect = Effect(
        left.value - float(np.log1p(-stated)), float(np.sqrt(left.se**2 + printed)), left.df
    )
    verdict = judge_effect(effect, margin, "ratio", "ln of what is left, ours - stated")
    low, high = (1 - np.exp(v) for v in reversed(left.interval(1 - LEVEL)))
    message = f"ours {ours.reduction:+.1%} less [{low:.1%}, {high:.1%}], stated {stated:.1%}"
    return replace(verdict, why=f"{message}; {verdict.why}")


def judge_ratio(ours: Pair, stated: float, digit: float, margin: float) -> Verdict:
    """Judges `twice as many` by the rule of reductions, in the words of a ratio."""
    verdict = judge_reduction(ours, 1 - stated, digit, margin)
    if verdict.effect != verdict.effect:
        return verdict
    left = ours.left()
    low, high = (float(np.exp(v)) for v in left.interval(1 - LEVEL))
    message = f"ours {np.exp(left.value):.2f} times [{low:.2f}, {high:.2f}], stated {stated:g}"
    return replace(verdict, why=f"{message}; {verdict.why.partition('; ')[2]}")


def reduction_shown(ours: Pair) -> bool:
    """Returns whether there is any reduction (one-sided, 5 %)."""
    left = ours.left()
    return left.value + left.se * stats.t.ppf(1 - LEVEL, left.df) < 0


def difference(ours: Pair, scale: float = 1.0) -> Effect:
    """Returns after - before (Welch), times `scale`."""
    one, two = ours.after, ours.before
    value, se, df = effects(
        one.value,
        one.sd or 0.0,
        one.count or 1,
        two.value,
        two.sd or 0.0,
        two.count or 1,
        "difference",
    )
    return Effect(scale * float(value), abs(scale) * float(se), float(df))


def judge_difference(
    ours: Pair,
    stated: float,
    digit: float = 0.0,
    scale: float = 1.0,
    margin: float = REDUCTION_MARGIN,
) -> Verdict:
    """Judges `x points more`: our difference must be within a fraction of the stated one."""
    if ours.fewest == 0:
        return not_run("no run")
    if ours.fewest < FEWEST_RUNS:
        return too_few(ours.fewest, "difference", None)
    found = difference(ours, scale)
    effect = Effect(found.value - stated, float(np.hypot(found.se, digit / 12**0.5)), found.df)
    verdict = judge_effect(
        effect, margin * abs(stated), "difference", "difference of ours - stated, Welch's t"
    )
    return replace(verdict, why=f"ours {found.value:+.3g}, stated {stated:+.3g}; {verdict.why}")


def judge_difference_bound(
    ours: Pair, op: Literal["lt", "le", "gt", "ge"], stated: float, scale: float = 1.0
) -> Verdict:
    """Judges `more than` and `less than x more` by the side on which the one-sided 95 % limits of
    our difference are."""
    if ours.fewest == 0:
        return not_run("no run")
    if ours.fewest < FEWEST_RUNS:
        return too_few(ours.fewest, "difference", None)
    below = op in ("lt", "le")
    found = difference(ours, scale)
    low, high = found.interval(0.9)
    message = f"ours {found.value:+.3g} [{low:+.3g}, {high:+.3g}]"
    verdict = Verdict(
        "inconclusive",
        f"{message}, stated {'<' if below else '>'} {stated:+.3g}",
        "one-sided 95 % limits of the difference, Welch's t",
        "difference",
        found.value - stated,
        low - stated,
        high - stated,
    )
    return _by_side(verdict, below)


def judge_reduction_bound(
    ours: Pair, op: Literal["lt", "le", "gt", "ge"], stated: float
) -> Verdict:
    """Judges `more than 50 % less` (stated: 0.5) by the one-sided 95 % limits of
    ln(after / before): more than 50 % less leaves less than the rest."""
    if ours.fewest == 0:
        return not_run("no run")
    if ours.fewest < FEWEST_RUNS:
        return too_few(ours.fewest, "ratio", None)
    if not (ours.before.value > 0 and ours.after.value > 0 and stated < 1):
        return Verdict("inconclusive", "a reduction of or to nothing", scale="ratio")
    left = ours.left()
    limit = float(np.log1p(-stated))
    low, high = left.interval(0.9)
    message = f"ours {ours.reduction:+.1%} less [{1 - np.exp(high):.1%}, {1 - np.exp(low):.1%}]"
    verdict = Verdict(
        "inconclusive",
        f"{message}, stated {stated:.1%}",
        "one-sided 95 % limits of ln(of / base)",
        "ratio",
        left.value - limit,
        low - limit,
        high - limit,
    )
    return _by_side(verdict, below=op in ("gt", "ge"))


def _by_side(found: Verdict, below: bool) -> Verdict:
    """Decides an open verdict by the side of zero on which both limits of its effect are."""
    if (found.high <= 0) if below else (found.low >= 0):
        return replace(found, outcome="reproduced")
    if (found.low > 0) if below else (found.high < 0):
        return replace(found, outcome="differs")
    return found


def judge_gap(ours: Pair, stated: float) -> Verdict:
    """Judges `within x %` (`stated` is a fraction) by the 90 % interval of after / before: inside
    1 -/+ x, or on one side of it."""
    if ours.fewest == 0:
        return not_run("no run")
    if ours.fewest < FEWEST_RUNS:
        return too_few(ours.fewest, "ratio", None)
    if not (ours.before.value > 0 and ours.after.value > 0):
        return Verdict("inconclusive", "a ratio of or to nothing", scale="ratio")
    left = ours.left()
    low, high = left.interval(0.9)
    floor, ceiling = float(np.log1p(-stated)), float(np.log1p(stated))
    found = Verdict(
        "inconclusive",
        f"ours {np.expm1(left.value):+.1%} [{np.expm1(low):+.1%}, {np.expm1(high):+.1%}], "
        f"stated within {stated:.1%}",
        "90 % interval of of / base",
        "ratio",
        left.value,
        low,
        high,
    )
    if floor <= low and high <= ceiling:
        return replace(found, outcome="reproduced")
    if high < floor or low > ceiling:
        return replace(found, outcome="differs")
    return found


def judge_up_to(
    ours: Mapping[str, Pair],
    stated: float,
    at: str,
    digit: float = 0.0,
    margin: float = REDUCTION_MARGIN,
) -> Verdict:
    """Judges `up to x % less`, where `at` is the paper's sequence with the largest reduction.

    Reproduced if (i) the reduction there is equivalent to x and (ii) no sequence's reduction
    exceeds x by more than the margin (one-sided, Holm). If one does, or if the effect there is
    smaller, it differs.
    """
    if at not in ours:
        return not_run(f"no run on {at}, where the paper has its maximum")
    there = judge_reduction(ours[at], stated, digit, margin)
    bound = float(np.log1p(-stated) - np.log1p(margin))
    judged = {name: pair for name, pair in ours.items() if pair.fewest >= FEWEST_RUNS}
    above = {name: _below(pair.left(), bound) for name, pair in judged.items()}
    smaller = there.outcome == "differs" and there.effect > 0
    everywhere = all(reduction_shown(pair) for pair in judged.values())
    return _largest(there, above, smaller, everywhere)


def judge_up_to_more(
    ours: Mapping[str, Pair],
    stated: float,
    at: str,
    digit: float = 0.0,
    scale: float = 1.0,
    margin: float = REDUCTION_MARGIN,
) -> Verdict:
    """Judges `up to x points more` by the same rule on differences; x is above zero."""
    if at not in ours:
        return not_run(f"no run on {at}, where the paper has its maximum")
    there = judge_difference(ours[at], stated, digit, scale, margin)
    bound = -stated * (1 + margin)
    judged = {name: pair for name, pair in ours.items() if pair.fewest >= FEWEST_RUNS}
    less = {name: difference(pair, -scale) for name, pair in judged.items()}
    above = {name: _below(found, bound) for name, found in less.items()}
    smaller = there.outcome == "differs" and there.effect < 0
    everywhere = all(_below(found, 0.0) <= LEVEL for found in less.values())
    return _largest(there, above, smaller, everywhere)


def _largest(
    there: Verdict, above: Mapping[str, float], smaller: bool, everywhere: bool
) -> Verdict:
    """Returns the verdict on a maximum; `above` has the p of each sequence that its effect is no
    larger."""
    adjusted = dict(zip(above, holm(list(above.values())), strict=True)) if above else {}
    larger = [name for name, p in adjusted.items() if p <= LEVEL]
    if larger:
        why = f"more than stated on {', '.join(larger)}; {there.why}"
        return replace(there, outcome="differs", why=why)
    if smaller:
        one = "a smaller effect, but one everywhere" if everywhere else "a smaller effect"
        return replace(there, why=f"{one}; {there.why}")
    return there


def _below(found: Effect, bound: float) -> float:
    """Returns p of the hypothesis that the effect is at or above the bound."""
    if found.se == 0:
        return 0.0 if found.value < bound else 1.0
    return float(stats.t.cdf((found.value - bound) / found.se, found.df))


def judge_about(ours: Mean, stated: Mean) -> Verdict:
    """Judges `about x` by equivalence with a margin of 25 %; the stated number has no spread of its
    own."""
    exact = replace(stated, sd=0.0, count=stated.count or 1)
    return judge_mean(ours, exact, ABOUT_MARGIN)


def judge_bound(ours: Mean | Share, op: Literal["lt", "le", "gt", "ge"], limit: float) -> Verdict:
    """Judges `more than` and `less than` by the side on which our one-sided 95 % limits are."""
    below = op in ("lt", "le")
    count = ours.runs if isinstance(ours, Share) else ours.count or 0
    scale: Scale = "points" if isinstance(ours, Share) else "difference"
    if count == 0:
        return not_run("no run")
    if count < FEWEST_RUNS:
        return too_few(count, scale, None)
    low, high = _limits(ours)
    message = (
        f"ours {ours.value:.4g} [{low:.4g}, {high:.4g}], stated {'<' if below else '>'} {limit:g}"
    )
    found = Verdict(
        "inconclusive",
        message,
        "one-sided 95 % limits",
        scale,
        ours.value - limit,
        low - limit,
        high - limit,
    )
    found = _by_side(found, below)
    if found.outcome == "inconclusive":
        return replace(found, why=f"{message}: the limit is between")
    return found


def judge_range(ours: Mean | Share, low: float, high: float) -> Verdict:
    """Judges `from a to b`: inside by both one-sided 95 % limits, or outside by one of them."""
    above, below = judge_bound(ours, "ge", low), judge_bound(ours, "le", high)
    for found in (above, below):
        if found.outcome in ("differs", "not_run"):
            return found
    if above.outcome == below.outcome == "reproduced":
        return replace(above, why=f"{above.why} and {below.why}")
    return above if above.outcome == "inconclusive" else below


def judge_set(ours: Sequence[Mean | None], stated: Sequence[Mean], margin: float) -> Verdict:
    """Judges `a and b`, each of its own condition: ours must match every element at its place."""
    found = [
        not_run(f"no run for {s.value:g}")
        if o is None
        else judge_mean(o, replace(s, sd=0.0, count=1), margin)
        for o, s in zip(ours, stated, strict=True)
    ]
    why = "; ".join(f"{s.value:g}: {v.why}" for s, v in zip(stated, found, strict=True))
    outcomes = [v.outcome for v in found]
    worst = next(
        (v for name in ("differs", "not_run", "inconclusive") for v in found if v.outcome == name),
        found[0],
    )
    if "differs" not in outcomes and "not_run" in outcomes and set(outcomes) != {"not_run"}:
        return replace(worst, outcome="inconclusive", why=why)
    return replace(worst, why=why)


def judge_window(inside: int, losses: int, time_share: float) -> Verdict:
    """Judges `at 22 s`: most losses are in the window, and more than its share of the time.

    `time_share` is the window's fraction of the time in which a loss could have happened.
    """
    if losses == 0:
        return not_run("nothing was lost, so nothing was lost at a time")
    if losses < FEWEST_RUNS:
        return too_few(losses, "points", None)
    share = inside / losses
    low, high = (float(v) for v in wilson_limits(inside, losses, stats.norm.ppf(1 - LEVEL / 2)))
    p_value = stats.binomtest(inside, losses, time_share, "greater").pvalue
    message = f"{inside} of {losses} losses in the window [{low:.0%}, {high:.0%}]"
    message += f", {time_share:.0%} of the time, p {p_value:.2g}"
    found = Verdict(
        "inconclusive",
        message,
        "Wilson; binomial test against the window's share of the time",
        "points",
        share - MOSTLY,
        low - MOSTLY,
        high - MOSTLY,
    )
    if p_value <= LEVEL and low > MOSTLY:
        return replace(found, outcome="reproduced")
    if high < MOSTLY:
        return replace(found, outcome="differs")
    return found


def _limits(ours: Mean | Share) -> tuple[float, float]:
    """Returns both one-sided 95 % limits."""
    if isinstance(ours, Share):
        low, high = wilson_limits(ours.bad, ours.runs, stats.norm.ppf(1 - LEVEL))
        return float(low), float(high)
    if not ours.sd or not ours.count:
        return ours.value, ours.value
    half = ours.sd / np.sqrt(ours.count) * stats.t.ppf(1 - LEVEL, ours.count - 1)
    return ours.value - float(half), ours.value + float(half)
