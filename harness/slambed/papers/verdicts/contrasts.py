# SPDX-License-Identifier: Apache-2.0
"""Judges declared orderings: whether the paper shows it, our runs show it, or the opposite is
shown.

A contrast is declared in papers/*/paper.yaml before anything runs, and never picked from results. A
statement about several pairs holds if each of them holds (intersection-union: no adjustment). It is
reversed if any opposite test passes after Holm's adjustment over all of them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import stats

from slambed.metrics.comparison import holm
from slambed.papers.verdicts.means import completed
from slambed.papers.verdicts.model import (
    FEWEST_RUNS,
    LEVEL,
    SEEN_POWER,
    Floats,
    Mean,
    OrderOutcome,
    Share,
)
from slambed.papers.verdicts.trends import (
    cochran_armitage,
    fisher_rising,
    jonckheere,
    means_rising,
    page,
    pair_rising,
    shares_rising,
)

Ours = Share | Floats
"""Our data of one cell: runs with a loss, or the values of single runs."""
Published = Share | Mean
POWER_DRAWS = 2000
POWER_SEED = 20261


@dataclass(frozen=True)
class Part:
    """One of several pairs of a contrast, Holm-adjusted over these."""

    outcome: Literal["holds", "reversed", "not_shown"]
    p_value: float
    """p that ours rise; for a reversed pair, that they fall."""


@dataclass(frozen=True)
class Ordering:
    """The verdict on one declared contrast."""

    outcome: OrderOutcome
    why: str
    formula: str = ""
    p_holds: float = float("nan")
    p_reversed: float = float("nan")
    p_paper: float = float("nan")
    power: float | None = None
    """Chance that our runs would have shown it if the paper's numbers were true."""
    spread: str = ""
    """The spread that `power` and `runs_needed` rest on; empty for shares, which need none."""
    runs_needed: int | None = None
    """Larger number of runs per cell that would show it if the paper's numbers were true; None if
    we have enough or no number would."""
    assumed: tuple[str, ...] = ()
    decides: int | None = None
    """The decisive step: the weakest, or the most clearly reversed one."""
    parts: tuple[Part, ...] = ()
    """The outcome of each step, if there are several and all have enough runs."""

    @property
    def chance(self) -> str:
        """Returns `power` as a sentence; empty without it."""
        if self.power is None:
            return ""
        by = f", by {self.spread}" if self.spread else ""
        return f"a difference as printed would have shown in {self.power:.0%} of campaigns{by}"


@dataclass(frozen=True)
class Step:
    """Cells whose values should rise in this order: two, or along a trend. `paper` is empty without
    printed numbers."""

    ours: tuple[Ours, ...]
    paper: tuple[Published, ...]
    label: str = ""

    @property
    def fewest(self) -> int:
        """Returns the runs of the smallest cell."""
        return min(_count(cell) for cell in self.ours) if self.ours else 0


def _count(cell: Ours) -> int:
    return cell.runs if isinstance(cell, Share) else len(cell)


def rising(cells: Sequence[Ours]) -> float:
    """Returns the one-sided p of the test that ours rise: pair or trend, shares or values."""
    if len(cells) == 2:
        return pair_rising(cells[0], cells[1])
    shares = [c for c in cells if isinstance(c, Share)]
    if len(shares) == len(cells):
        return shares_rising(shares)
    return jonckheere([np.asarray(c) for c in cells if not isinstance(c, Share)])


def paper_rising(step: Step) -> tuple[float, tuple[str, ...]]:
    """Returns the one-sided p of the test that the paper's own numbers rise, and the
    assumptions."""
    shares = [c for c in step.paper if isinstance(c, Share)]
    if len(shares) == len(step.paper):
        return rising(shares), ()
    means: list[Mean] = []
    assumed: dict[str, None] = {}
    spread = _usual_spread(step)
    for number, cell in enumerate(step.paper):
        assert isinstance(cell, Mean)
        own = step.ours[number] if number < len(step.ours) else None
        measured = Mean.of(own) if isinstance(own, np.ndarray) else Mean(1.0)
        if measured.cv is None:
            measured = Mean(1.0, spread, None)
        whole, assumptions = completed(cell, measured)
        means.append(whole)
        assumed |= dict.fromkeys(assumptions)
    return means_rising(means), tuple(assumed)


USUAL_CV = 0.2
"""Assumed coefficient of variation of run means, if neither the paper nor we have a spread
(flagged)."""


def _measured_spread(step: Step) -> float | None:
    found = [Mean.of(c).cv for c in step.ours if not isinstance(c, Share)]
    known = [cv for cv in found if cv is not None]
    return float(np.median(known)) if known else None


def _usual_spread(step: Step) -> float:
    measured = _measured_spread(step)
    return USUAL_CV if measured is None else measured


def _spread_words(measured: Sequence[float | None]) -> str:
    """Returns `the spread of our runs (2 to 6 %)`, one value per step or cell; a None was not
    measured, so the usual spread stood in."""
    known = sorted(100 * value for value in measured if value is not None)
    if not known:
        return f"an assumed spread of {100 * USUAL_CV:.0f} %"
    ends = dict.fromkeys(f"{value:.2g}" for value in (known[0], known[-1]))
    words = f"the spread of our runs ({' to '.join(ends)} %)"
    whole = len(known) == len(measured)
    return words if whole else f"{words}, {100 * USUAL_CV:.0f} % where they have none"


def paper_shows(steps: Sequence[Step]) -> tuple[float, tuple[str, ...]]:
    """Returns p of the paper's own numbers, that of the weakest step, and the assumptions. The
    caller adjusts it over the contrasts declared on the same table (Holm)."""
    found = [paper_rising(step) for step in steps]
    assumptions = tuple(dict.fromkeys(a for _, assumed in found for a in assumed))
    return max(p for p, _ in found), assumptions


def judge_contrast(
    steps: Sequence[Step], p_paper: float, assumed: tuple[str, ...] = ()
) -> Ordering:
    """Judges whether ours rise in every step. `p_paper` is the paper's own p, adjusted
    (`paper_shows`); NaN if the paper gives no numbers."""
    base = Ordering("inconclusive", "", _formula(steps), p_paper=p_paper, assumed=assumed)
    fewest = min((step.fewest for step in steps), default=0)
    if fewest >= FEWEST_RUNS:
        forward = [rising(step.ours) for step in steps]
        backward = holm([rising(step.ours[::-1]) for step in steps])
        base = replace(
            base,
            p_holds=max(forward),
            p_reversed=float(backward.min()),
            decides=int(np.argmax(forward)),
            parts=_parts(forward, list(backward)),
        )
    if p_paper > LEVEL:
        why = f"the paper's own numbers do not show it (p {p_paper:.2g})"
        return replace(base, outcome="not_shown_by_paper", why=why)
    if fewest == 0:
        return replace(base, why="no run of ours behind one of its numbers")
    if fewest < FEWEST_RUNS:
        why = f"{fewest} runs behind one of its numbers, {FEWEST_RUNS} are the least"
        needed, spread = runs_to_show(steps), _spread_of(steps)
        return replace(
            base,
            outcome="too_few_runs",
            why=why,
            runs_needed=needed,
            spread=spread if needed else "",
        )
    message = f"p {base.p_holds:.2g}" + (f" (largest of {len(steps)})" if len(steps) > 1 else "")
    if base.p_holds <= LEVEL:
        return replace(base, outcome="holds", why=message)
    if base.p_reversed <= LEVEL:
        shown = int(np.argmin(backward))
        base = replace(base, decides=shown)
        where = steps[shown].label
        why = f"the opposite is shown{f' at {where}' if where else ''}, p {base.p_reversed:.2g}"
        return replace(base, outcome="reversed", why=f"{why} (Holm)" if len(steps) > 1 else why)
    if not all(step.paper for step in steps):
        return replace(base, why=f"{message}; {NO_SIZE}")
    power = power_of(steps, [[_count(c) for c in step.ours] for step in steps])
    base = replace(base, spread=_spread_of(steps))
    return _not_shown(base, message, power, lambda: runs_to_show(steps, above=fewest))


def _spread_of(steps: Sequence[Step]) -> str:
    means = [step for step in steps if not all(isinstance(c, Share) for c in step.paper)]
    return _spread_words([_measured_spread(step) for step in means]) if means else ""


NO_SIZE = (
    "the paper prints no numbers with a spread, from which to compute how many runs would show it"
)


def _not_shown(
    base: Ordering, reported: str, power: float, needed: Callable[[], int | None]
) -> Ordering:
    """Returns the verdict if neither it nor its opposite is shown; `power` is the chance that it
    would have been, if the paper's numbers were true."""
    base = replace(base, why=reported, power=power)
    if power >= SEEN_POWER:
        return replace(base, outcome="not_seen")
    return replace(base, outcome="too_few_runs", runs_needed=needed())


def _parts(forward: Sequence[float], backward: Sequence[float]) -> tuple[Part, ...]:
    """Returns the outcome of each step. `k of m hold` is a count, so each p is adjusted over m,
    unless all hold."""
    if len(forward) < 2:
        return ()
    adjusted = forward if max(forward) <= LEVEL else list(holm(list(forward)))
    return tuple(
        Part("reversed", float(down))
        if up > LEVEL >= down
        else Part("holds" if up <= LEVEL else "not_shown", float(up))
        for up, down in zip(adjusted, backward, strict=True)
    )


def judge_blocks(
    ours: Floats,
    paper: Floats,
    adjusted_p: float | None = None,
    spread: Floats | None = None,
    runs: Floats | None = None,
) -> Ordering:
    """Judges systems in the printed order over sequences by Page's L over rows of means;
    inconclusive if a cell has no runs (NaN). `spread` has our coefficients of variation per cell,
    for the power; without it, no power is computed."""
    formula = "Page's L over sequences, exact or by permutation (scipy); Kendall's tau-b described"
    p_paper = page(paper) if adjusted_p is None else adjusted_p
    whole = bool(np.isfinite(ours).all())
    p_holds, p_reversed = (page(ours), page(ours[:, ::-1])) if whole else (np.nan, np.nan)
    if p_paper > LEVEL:
        why = f"the paper's own numbers do not show it (p {p_paper:.2g})"
        return Ordering("not_shown_by_paper", why, formula, p_holds, p_reversed, p_paper)
    if not whole:
        return Ordering("inconclusive", "a number without runs of ours", formula, p_paper=p_paper)
    if runs is not None and (fewest := int(runs.min())) < FEWEST_RUNS:
        why = f"{fewest} runs behind one of its numbers, {FEWEST_RUNS} are the least"
        return Ordering("too_few_runs", why, formula, p_paper=p_paper)
    tau = float(stats.kendalltau(ours.ravel(), paper.ravel()).statistic)
    why = f"p {min(p_holds, p_reversed):.2g}, tau-b ours / paper {tau:.2f}"
    base = Ordering("inconclusive", why, formula, p_holds, p_reversed, p_paper)
    if p_holds <= LEVEL:
        return replace(base, outcome="holds")
    if p_reversed <= LEVEL:
        return replace(base, outcome="reversed")
    if spread is None or runs is None:
        return base
    cv = np.where(np.isfinite(spread), spread, USUAL_CV)
    measured = [float(c) if np.isfinite(c) else None for c in spread.flat]
    base = replace(base, spread=_spread_words(measured))
    power = blocks_power(paper, cv / np.sqrt(runs))
    fewest = int(runs.min())
    more = (n for n in RUNS_TRIED if n > fewest)
    return _not_shown(
        base,
        why,
        power,
        lambda: next((n for n in more if blocks_power(paper, cv / n**0.5) >= SEEN_POWER), None),
    )


def blocks_power(paper: Floats, error: Floats) -> float:
    """Returns the chance that Page's L passes if the paper's numbers are true and ours have these
    relative standard errors. Simulated with a fixed seed."""
    generator = np.random.default_rng(POWER_SEED)
    drawn = paper * (1 + error * generator.standard_normal((POWER_DRAWS, *paper.shape)))
    ranks = stats.rankdata(drawn, axis=2)
    scores = (ranks.sum(axis=1) * np.arange(1, paper.shape[1] + 1)).sum(axis=1)
    unique, first, counts = np.unique(scores, return_index=True, return_counts=True)
    passed = [page(drawn[number]) <= LEVEL for number in first]
    return float(counts[passed].sum() / len(drawn)) if len(unique) else 0.0


def power_of(steps: Sequence[Step], counts: Sequence[Sequence[int]]) -> float:
    """Returns the chance that all steps pass with these runs per cell, if the paper's numbers are
    true.

    Simulated with a fixed seed; the steps are drawn independently.
    """
    generator = np.random.default_rng(POWER_SEED)
    passed = np.ones(POWER_DRAWS, dtype=bool)
    for step, runs in zip(steps, counts, strict=True):
        passed &= _draw(step, np.asarray(runs), generator) <= LEVEL
    return float(passed.mean())


def _draw(step: Step, runs: np.ndarray, generator: np.random.Generator) -> Floats:
    shares = [c for c in step.paper if isinstance(c, Share)]
    if len(shares) == len(step.paper):
        true = np.array([s.value for s in shares])
        bad = generator.binomial(runs, true, (POWER_DRAWS, len(runs)))
        if len(runs) == 2:
            return np.asarray(fisher_rising(bad[:, 0], runs[0], bad[:, 1], runs[1]))
        return np.asarray(cochran_armitage(bad, np.broadcast_to(runs, bad.shape)))
    means = np.array([c.value for c in step.paper if isinstance(c, Mean)])
    spread = _usual_spread(step) * np.abs(means) / np.sqrt(runs)
    weight = np.arange(len(means)) - (len(means) - 1) / 2
    drawn = generator.normal(means, spread, (POWER_DRAWS, len(means))) @ weight
    error = float(np.sqrt((weight**2 * spread**2).sum()))
    freedom = max(float(runs.sum()) - len(runs), 1.0)
    if not error:
        return np.where(drawn > 0, 0.0, 1.0)
    return np.asarray(stats.t.sf(drawn / error, freedom))


RUNS_TRIED = (5, 10, 15, 20, 30, 50, 75, 100, 150, 200, 300)


def runs_to_show(steps: Sequence[Step], wanted: float = SEEN_POWER, above: int = 0) -> int | None:
    """Returns the fewest runs per cell, more than `above`, with this power under the paper's
    numbers; None above 300, or without printed numbers."""
    if not all(step.paper for step in steps):
        return None
    for runs in RUNS_TRIED:
        if runs > above and power_of(steps, [[runs] * len(step.paper) for step in steps]) >= wanted:
            return runs
    return None


def _formula(steps: Sequence[Step]) -> str:
    if not steps:
        return ""
    first = steps[0]
    shares = all(isinstance(c, Share) for c in first.paper or first.ours)
    if len(first.paper or first.ours) == 2:
        test = "Fisher's exact test" if shares else "Mann-Whitney"
    else:
        test = "Cochran-Armitage" if shares else "Jonckheere-Terpstra"
    several = f", each of {len(steps)} at {LEVEL:.0%} (intersection-union)"
    return f"{test}, one-sided" + (several if len(steps) > 1 else "")
