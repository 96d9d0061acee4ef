# SPDX-License-Identifier: Apache-2.0
"""Judges shares (runs with a track loss): the same within a margin, different, or undecided."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from slambed.metrics.changes import newcombe
from slambed.papers.verdicts.model import (
    FEWEST_RUNS,
    LEVEL,
    MOST_RUNS,
    RUN_COUNTS,
    Share,
    Verdict,
    not_run,
    too_few,
)

MARGIN = 0.15
MARGIN_AT_THE_ENDS = 0.10
NEAR_THE_END = 0.05
FORMULA = "Newcombe's hybrid score interval of ours - paper (1998, method 10), Wilson ends"


def margin_of(paper: Share) -> float:
    """Returns 15 points, or 10 if the paper prints at most 5 or at least 95 %."""
    near = min(paper.value, 1 - paper.value) <= NEAR_THE_END
    return MARGIN_AT_THE_ENDS if near else MARGIN


def decide(
    ours_bad: ArrayLike,
    ours_runs: ArrayLike,
    paper_bad: ArrayLike,
    paper_runs: ArrayLike,
    margin: ArrayLike,
) -> tuple[Any, Any]:
    """Returns (reproduced, differs) for arrays of counts. Reproduced: the 90 % interval is inside
    the margins (two one-sided tests at 5 %). Differs: not so, and the 95 % interval excludes
    zero."""
    bound = np.asarray(margin)
    low90, high90 = newcombe(ours_bad, ours_runs, paper_bad, paper_runs, 1 - 2 * LEVEL)
    low95, high95 = newcombe(ours_bad, ours_runs, paper_bad, paper_runs, 1 - LEVEL)
    same = (low90 > -bound) & (high90 < bound)
    enough = np.asarray(ours_runs) >= FEWEST_RUNS
    return same & enough, ~same & ((low95 > 0) | (high95 < 0)) & enough


def judge_share(ours: Share, paper: Share, margin: float | None = None) -> Verdict:
    """Judges ours against a published share of known runs; `margin` is a fraction."""
    if ours.runs == 0:
        return not_run("no run")
    bound = margin_of(paper) if margin is None else margin
    if ours.runs < FEWEST_RUNS:
        return too_few(ours.runs, "points", runs_to_decide(ours, paper, bound))
    same, differs = decide(ours.bad, ours.runs, paper.bad, paper.runs, bound)
    low, high = newcombe(ours.bad, ours.runs, paper.bad, paper.runs, 1 - LEVEL)
    effect = ours.value - paper.value
    message = f"{100 * effect:+.0f} points [{100 * float(low):+.0f}, {100 * float(high):+.0f}]"
    found = Verdict(
        "inconclusive",
        f"{message}, neither within {100 * bound:.3g} nor excluding zero",
        FORMULA,
        "points",
        effect,
        float(low),
        float(high),
        bound,
    )
    if same:
        why = f"{message}, 90 % within {100 * bound:.3g}"
        return replace(found, outcome="reproduced", why=why)
    if differs:
        why = f"{message}, 95 % excludes zero"
        return replace(found, outcome="differs", why=why)
    return replace(found, runs_needed=runs_to_decide(ours, paper, bound))


def runs_to_decide(ours: Share, paper: Share, margin: float) -> int | None:
    """Returns the fewest runs of ours that decide if our share stays the same; None if none do."""
    for runs in RUN_COUNTS:
        if runs > ours.runs:
            bad = round(ours.value * runs)
            if any(map(bool, decide(bad, runs, paper.bad, paper.runs, margin))):
                return runs
    return None


def chance_to_reproduce(paper: Share, runs: int, margin: float | None = None) -> float:
    """Returns the chance of `reproduced` if ours is the same system. Our count is beta-binomial,
    because the published count leaves the true share open."""
    bound = margin_of(paper) if margin is None else margin
    k = np.arange(runs + 1)
    same, _ = decide(k, runs, paper.bad, paper.runs, bound)
    chance = stats.betabinom.pmf(k, runs, paper.bad + 0.5, paper.runs - paper.bad + 0.5)
    return float(chance @ same)


def rate(
    ours: float,
    paper: float,
    ours_runs: int,
    paper_runs: int,
    margin: Callable[[Share], float] = margin_of,
) -> tuple[float, float]:
    """Returns exact P(reproduced) and P(differs) for true shares, with both counts binomial."""
    k, m = np.arange(ours_runs + 1), np.arange(paper_runs + 1)
    bounds = np.array([margin(Share(int(bad), paper_runs)) for bad in m])
    same, differs = decide(k[:, None], ours_runs, m[None, :], paper_runs, bounds[None, :])
    a, b = stats.binom.pmf(k, ours_runs, ours), stats.binom.pmf(m, paper_runs, paper)
    return float(a @ same @ b), float(a @ differs @ b)


def can_be_shown(paper: Share, margin: float) -> bool:
    """Returns whether MOST_RUNS runs would reproduce an equal share."""
    same, _ = decide(round(paper.value * MOST_RUNS), MOST_RUNS, paper.bad, paper.runs, margin)
    return bool(same)
