# SPDX-License-Identifier: Apache-2.0
"""Declared orderings: does the paper show it, do ours, and is the opposite shown?

A contrast is declared in papers/*/paper.yaml before anything is run, never found in a table. A
statement about several pairs holds when each of them holds (intersection-union: no adjustment); it
is reversed when any opposite test passes after Holm's adjustment over all of them.
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

ContrastKind = Literal["pair", "trend", "all_below", "blocks"]
Ours = Share | Floats
"""What we have at one cell: losses of runs, or the values of single runs."""
Published = Share | Mean
POWER_DRAWS = 2000
POWER_SEED = 20261


@dataclass(frozen=True)
class Part:
    """One of several pairs of a contrast, as one of so many (Holm)."""

    outcome: Literal["holds", "reversed", "not_shown"]
    p_value: float
    """That ours rise; of a reversed one, that they fall."""


@dataclass(frozen=True)
class Ordering:
    """What is said of one declared contrast."""

    outcome: OrderOutcome
    why: str
    formula: str = ""
    p_holds: float = float("nan")
    p_reversed: float = float("nan")
    p_paper: float = float("nan")
    power: float | None = None
    """Chance that ours would have shown it, had it been as in the paper."""
    runs_needed: int | None = None
    """More runs per cell that would show it, were it as in the paper; None where we have those."""
    assumed: tuple[str, ...] = ()
    decides: int | None = None
    """The step that the outcome hangs on: the weakest, or the one that is most surely reversed."""
    parts: tuple[Part, ...] = ()
    """What each step says for itself, where there are several and all have runs enough."""


@dataclass(frozen=True)
class Step:
    """Cells whose values are said to rise in this order: two, or along a trend. `paper` is empty
    where it prints no numbers."""

    ours: tuple[Ours, ...]
    paper: tuple[Published, ...]
    label: str = ""

    @property
    def fewest(self) -> int:
        """Runs of the smallest cell."""
        return min(_count(cell) for cell in self.ours) if self.ours else 0


def _count(cell: Ours) -> int:
    return cell.runs if isinstance(cell, Share) else len(cell)


def rising(cells: Sequence[Ours]) -> float:
    """p that ours rise: pair or trend, shares or values."""
    if len(cells) == 2:
        return pair_rising(cells[0], cells[1])
    shares = [c for c in cells if isinstance(c, Share)]
    if len(shares) == len(cells):
        return shares_rising(shares)
    return jonckheere([np.asarray(c) for c in cells if not isinstance(c, Share)])


def paper_rising(step: Step) -> tuple[float, tuple[str, ...]]:
    """p that the paper's own numbers rise, and what had to be assumed for it."""
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
"""Of run means in this field, where neither the paper nor we have a spread (flagged)."""


def _usual_spread(step: Step) -> float:
    known = [m.cv for c in step.ours if not isinstance(c, Share) and (m := Mean.of(c)).cv]
    return float(np.median(known)) if known else USUAL_CV


def paper_shows(steps: Sequence[Step]) -> tuple[float, tuple[str, ...]]:
    """p by the paper's own numbers, as weak as the weakest step, and what was assumed for it. The
    caller adjusts it over the contrasts declared on the same table (Holm)."""
    found = [paper_rising(step) for step in steps]
    assumptions = tuple(dict.fromkeys(a for _, assumed in found for a in assumed))
    return max(p for p, _ in found), assumptions


def judge_contrast(
    steps: Sequence[Step], p_paper: float, assumed: tuple[str, ...] = ()
) -> Ordering:
    """Whether ours rise in every step. `p_paper` is the paper's own, adjusted (`paper_shows`); NaN
    where the paper says it in words only."""
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
        return replace(base, why="no run of ours in one of its cells")
    if fewest < FEWEST_RUNS:
        why = f"{fewest} runs in one of its cells, {FEWEST_RUNS} are the least"
        return replace(base, outcome="too_few_runs", why=why, runs_needed=runs_to_show(steps))
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
    return _not_shown(base, message, power, lambda: runs_to_show(steps, above=fewest))


NO_SIZE = "the paper prints no numbers from which to compute how many runs would show it"


def _not_shown(
    base: Ordering, reported: str, power: float, needed: Callable[[], int | None]
) -> Ordering:
    """Neither it nor its opposite: with this chance it would have shown, were the paper right."""
    why = f"{reported}; a difference as printed would have shown in {power:.0%} of campaigns"
    base = replace(base, why=why, power=power)
    if power >= SEEN_POWER:
        return replace(base, outcome="not_seen")
    return replace(base, outcome="too_few_runs", runs_needed=needed())


def _parts(forward: Sequence[float], backward: Sequence[float]) -> tuple[Part, ...]:
    """`k of m hold` is a count, so each p is adjusted over m; that all hold is not."""
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
    """Systems in the printed order over sequences: Page's L over the rows of means, which say
    nothing where a cell has no runs (NaN). `spread`: coefficients of variation of ours, cell by
    cell, for the power; where it is not given, ours are taken for what they are."""
    formula = "Page's L over sequences, exact or by permutation (scipy); Kendall's tau-b described"
    p_paper = page(paper) if adjusted_p is None else adjusted_p
    if p_paper > LEVEL:
        why = f"the paper's own numbers do not show it (p {p_paper:.2g})"
        return Ordering("not_shown_by_paper", why, formula, p_paper=p_paper)
    if not np.isfinite(ours).all():
        return Ordering("inconclusive", "a cell without runs of ours", formula, p_paper=p_paper)
    p_holds, p_reversed = page(ours), page(ours[:, ::-1])
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
    """Chance that Page's L passes if the paper's numbers are true and ours have these standard
    errors, as parts of them. Simulated with a fixed seed."""
    generator = np.random.default_rng(POWER_SEED)
    drawn = paper * (1 + error * generator.standard_normal((POWER_DRAWS, *paper.shape)))
    ranks = stats.rankdata(drawn, axis=2)
    scores = (ranks.sum(axis=1) * np.arange(1, paper.shape[1] + 1)).sum(axis=1)
    unique, first, counts = np.unique(scores, return_index=True, return_counts=True)
    passed = [page(drawn[number]) <= LEVEL for number in first]
    return float(counts[passed].sum() / len(drawn)) if len(unique) else 0.0


def power_of(steps: Sequence[Step], counts: Sequence[Sequence[int]]) -> float:
    """Chance that all steps pass with these runs per cell, if the paper's numbers are true.

    Simulated with a fixed seed; the cells of different steps are drawn apart.
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
    return np.asarray(stats.t.sf(drawn / error, freedom)) if error else np.zeros(POWER_DRAWS)


RUNS_TRIED = (5, 10, 15, 20, 30, 50, 75, 100, 150, 200, 300)


def runs_to_show(steps: Sequence[Step], wanted: float = SEEN_POWER, above: int = 0) -> int | None:
    """Fewest runs per cell, more than `above`, with this power under the paper's numbers; None
    above 300, or where the paper prints no numbers."""
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
