# SPDX-License-Identifier: Apache-2.0
"""Judges means (times, errors, CPU): the same within a margin, different, or undecided.

A mean on a ratio scale is judged by ln(ours / paper); a bounded one (coverage, 0 to 100 %) by the
difference in its own unit.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import special, stats

from slambed.papers.verdicts.model import (
    ASSUMED_COUNT,
    FEWEST_RUNS,
    LEVEL,
    RUN_COUNTS,
    Mean,
    Verdict,
    not_run,
    too_few,
)

Kind = Literal["ratio", "difference"]
ENDLESS = 1e9
"""Degrees of freedom that stand in for infinity: t equals the normal distribution to all printed
digits."""
FORMULAE = {
    "ratio": "ln(ours / paper), delta method, Welch's t; u / sqrt(12) for the last printed digit",
    "difference": "ours - paper, Welch's t; u / sqrt(12) for the last printed digit",
}


@dataclass(frozen=True)
class Effect:
    """An effect with its standard error and degrees of freedom."""

    value: float
    se: float
    df: float

    def interval(self, confidence: float) -> tuple[float, float]:
        half = self.se * quantile(0.5 + confidence / 2, self.df)
        return self.value - half, self.value + half


def quantile(level: float, df: float) -> float:
    """Returns the quantile of Student's t, or of the normal distribution for infinite degrees of
    freedom."""
    return float(special.stdtrit(df, level)) if np.isfinite(df) else float(special.ndtri(level))


def decide(effect: ArrayLike, se: ArrayLike, df: ArrayLike, bound: ArrayLike) -> tuple[Any, Any]:
    """Returns (reproduced, differs) for arrays. Reproduced: the 90 % interval is inside the bounds
    (two one-sided tests at 5 %). Differs: not so, and the 95 % interval excludes zero."""
    value, error, freedom = np.asarray(effect), np.asarray(se), np.minimum(df, ENDLESS)
    half90 = error * special.stdtrit(freedom, 1 - LEVEL)
    half95 = error * special.stdtrit(freedom, 1 - LEVEL / 2)
    same = np.abs(value) + half90 < np.asarray(bound)
    return same, ~same & (np.abs(value) > half95)


def margin_bound(margin: float, kind: Kind) -> float:
    """Returns the margin on the axis of the effect: 20 % means ln 1.2 in both directions."""
    return float(np.log1p(margin)) if kind == "ratio" else margin


def completed(paper: Mean, ours: Mean) -> tuple[Mean, tuple[str, ...]]:
    """Returns the published mean with assumed values for what is not printed, and these
    assumptions."""
    assumed: list[str] = []
    if paper.count is None:
        paper = replace(paper, count=ASSUMED_COUNT)
        assumed.append(f"n = {ASSUMED_COUNT} in the paper")
    if paper.sd is None and ours.cv is not None:
        paper = replace(paper, sd=ours.cv * abs(paper.value))
        assumed.append(f"spread in the paper as ours ({ours.cv:.0%})")
    return paper, tuple(assumed)


def effect_of(ours: Mean, paper: Mean, kind: Kind) -> Effect:
    """Returns the effect of two means with count and spread (`completed`); a missing spread counts
    as 0."""
    value, se, df = effects(
        ours.value,
        ours.sd or 0.0,
        ours.count or 1,
        paper.value,
        paper.sd or 0.0,
        paper.count or 1,
        kind,
        (ours.digit, paper.digit),
    )
    return Effect(float(value), float(se), float(df))


def effects(
    ours: ArrayLike,
    ours_sd: ArrayLike,
    ours_runs: ArrayLike,
    paper: ArrayLike,
    paper_sd: ArrayLike,
    paper_runs: ArrayLike,
    kind: Kind,
    digits: tuple[float, float] = (0.0, 0.0),
) -> tuple[Any, Any, Any]:
    """Returns (effect, standard error, degrees of freedom) for arrays of means.

    Degrees of freedom are Welch-Satterthwaite's. The rounding of a printed number is known exactly,
    so its variance u^2 / 12 costs no degrees of freedom.
    """
    a, b = np.asarray(ours, dtype=np.float64), np.asarray(paper, dtype=np.float64)
    one, two = (np.abs(a), np.abs(b)) if kind == "ratio" else (np.ones_like(a), np.ones_like(b))
    n1, n2 = np.asarray(ours_runs), np.asarray(paper_runs)
    v1, v2 = (np.asarray(ours_sd) / one) ** 2 / n1, (np.asarray(paper_sd) / two) ** 2 / n2
    variance = v1 + v2 + ((digits[0] / one) ** 2 + (digits[1] / two) ** 2) / 12
    loss = v1**2 / np.maximum(n1 - 1, 1) + v2**2 / np.maximum(n2 - 1, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        df = np.where(loss > 0, variance**2 / loss, np.inf)
    return (np.log(a / b) if kind == "ratio" else a - b), np.sqrt(variance), df


def judge_effect(
    found: Effect, margin: float, kind: Kind, formula: str, assumed: tuple[str, ...] = ()
) -> Verdict:
    """Judges by two one-sided t tests against the margin, then by a two-sided test of no effect."""
    bound = margin_bound(margin, kind)
    low, high = found.interval(1 - LEVEL)
    same, differs = decide(found.value, found.se, found.df, bound)
    reported = _in_words(found.value, low, high, kind)
    limit = f"{margin:.0%}" if kind == "ratio" else f"{margin:.3g}"
    verdict = Verdict(
        "inconclusive",
        f"{reported}, neither within {limit} nor excluding {_none(kind)}",
        formula,
        kind,
        found.value,
        low,
        high,
        margin,
        None,
        assumed,
    )
    if same:
        why = f"{reported}, 90 % within {limit}"
        return replace(verdict, outcome="reproduced", why=why)
    if differs:
        why = f"{reported}, 95 % excludes {_none(kind)}"
        return replace(verdict, outcome="differs", why=why)
    return verdict


def judge_mean(ours: Mean, paper: Mean, margin: float, kind: Kind = "ratio") -> Verdict:
    """Judges ours against a published mean; `margin` is a fraction (0.2) or, for `difference`, in
    the unit."""
    if not ours.count:
        return not_run("no run")
    if kind == "ratio" and not (ours.value > 0 and paper.value > 0):
        return Verdict("inconclusive", "a ratio of means that are not above zero", scale="ratio")
    if ours.count < FEWEST_RUNS:
        return too_few(ours.count, kind, runs_to_decide(ours, paper, margin, kind))
    whole, assumed = completed(paper, ours)
    found = judge_effect(effect_of(ours, whole, kind), margin, kind, FORMULAE[kind], assumed)
    if found.outcome == "inconclusive":
        return replace(found, runs_needed=runs_to_decide(ours, paper, margin, kind))
    return found


def runs_to_decide(ours: Mean, paper: Mean, margin: float, kind: Kind) -> int | None:
    """Returns the fewest runs that decide if our mean and spread stay the same; None if none do, or
    without a spread."""
    if ours.sd is None or ours.count is None:
        return None
    whole, _ = completed(paper, ours)
    for runs in RUN_COUNTS:
        if runs > ours.count:
            found = effect_of(replace(ours, count=runs), whole, kind)
            if any(decide(found.value, found.se, found.df, margin_bound(margin, kind))):
                return runs
    return None


def chance_to_reproduce(
    paper: Mean, cv: float, runs: int, margin: float, kind: Kind = "ratio"
) -> float:
    """Returns the chance of `reproduced` if ours is the same system with this coefficient of
    variation (normal approximation, because the published mean leaves the true one open)."""
    spread = cv * abs(paper.value)
    whole, _ = completed(paper, Mean(paper.value, spread, runs))
    found = effect_of(Mean(paper.value, spread, runs), whole, kind)
    room = margin_bound(margin, kind) - found.se * quantile(1 - LEVEL, found.df)
    if room <= 0 or found.se == 0:
        return float(room > 0)
    return float(2 * stats.norm.cdf(room / found.se) - 1)


def _none(kind: Kind) -> str:
    return "one" if kind == "ratio" else "zero"


def _in_words(value: float, low: float, high: float, kind: Kind) -> str:
    if kind == "ratio":
        a, b, c = np.exp([value, low, high])
        return f"ours / paper {a:.2f} [{b:.2f}, {c:.2f}]"
    return f"{value:+.3g} [{low:+.3g}, {high:+.3g}]"
