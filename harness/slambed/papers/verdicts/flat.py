# SPDX-License-Identifier: Apache-2.0
"""Judges a statement of no effect: all cells have the same value within a margin.

A test that finds no difference shows nothing, since few runs find none either. So every pair of
cells must be equal within the margin (two one-sided tests at 5 %, intersection-union).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy import special

from slambed.metrics.comparison import holm
from slambed.papers.verdicts.contrasts import Ordering, Part, Step
from slambed.papers.verdicts.means import ENDLESS, effect_of, margin_bound
from slambed.papers.verdicts.model import FEWEST_RUNS, LEVEL, Floats, Mean, Share

FORMULA = "ln of the ratio of every two points, Welch's t, two one-sided tests (intersection-union)"


@dataclass(frozen=True)
class _Chain:
    """The two cells of a chain that differ most, with p values over all of its pairs."""

    farthest: float
    """ln of the largest ratio of two means."""
    p_same: float
    """p that every two cells are within the margin."""
    p_apart: float
    """p that two cells are farther apart than the margin, Holm-adjusted over all chains."""


def judge_flat(steps: Sequence[Step], margin: float) -> Ordering:
    """Judges whether the cells of each step are equal within `margin`, a ratio (0.2 allows a factor
    of 1.2 either way). `holds` if each step's are, `reversed` if two cells are farther apart than
    that. Raises ValueError for shares."""
    base = Ordering("inconclusive", "", FORMULA)
    fewest = min(step.fewest for step in steps)
    if fewest < FEWEST_RUNS:
        why = f"{fewest} runs behind one of its numbers, {FEWEST_RUNS} are the least"
        return replace(base, outcome="too_few_runs", why=why)
    cells = [_values(step) for step in steps]
    if min(float(cell.mean()) for chain in cells for cell in chain) <= 0:
        return replace(base, why="a ratio of means that are not above zero")
    chains = _chains(cells, margin_bound(margin, "ratio"))
    weakest = int(np.argmax([chain.p_same for chain in chains]))
    base = replace(
        base,
        p_holds=max(chain.p_same for chain in chains),
        p_reversed=min(chain.p_apart for chain in chains),
        decides=weakest,
        parts=_parts(chains),
    )
    if base.p_holds <= LEVEL:
        found = f"the farthest two differ by a factor of {np.exp(chains[weakest].farthest):.2f}"
        why = f"{found}, every two by less than {1 + margin:g} (p {base.p_holds:.2g})"
        return replace(base, outcome="holds", why=why)
    if base.p_reversed <= LEVEL:
        weakest = int(np.argmin([chain.p_apart for chain in chains]))
        found = f"two points differ by a factor of {np.exp(chains[weakest].farthest):.2f}"
        why = f"{found}, by more than {1 + margin:g} (p {base.p_reversed:.2g}, Holm)"
        return replace(base, outcome="reversed", why=why, decides=weakest)
    found = f"the farthest two differ by a factor of {np.exp(chains[weakest].farthest):.2f}"
    why = f"{found}, neither surely less nor surely more than {1 + margin:g}"
    return replace(base, why=f"{why} (p {base.p_holds:.2g})")


def _values(step: Step) -> list[Floats]:
    if any(isinstance(cell, Share) for cell in step.ours):
        raise ValueError("shares of runs have no ratio")
    return [np.asarray(cell, dtype=np.float64) for cell in step.ours]


def _chains(cells: Sequence[Sequence[Floats]], bound: float) -> list[_Chain]:
    effects = [
        [effect_of(Mean.of(a), Mean.of(b), "ratio") for a, b in combinations(chain, 2)]
        for chain in cells
    ]
    # P(within the bound) and P(beyond it) share the distance to the nearer end of the bound.
    same = [max(_tail(bound - abs(e.value), e.se, e.df) for e in found) for found in effects]
    apart = [_tail(abs(e.value) - bound, e.se, e.df) for found in effects for e in found]
    adjusted = iter(holm(apart))
    return [
        _Chain(max(abs(e.value) for e in found), p_same, float(min(next(adjusted) for _ in found)))
        for found, p_same in zip(effects, same, strict=True)
    ]


def _tail(distance: float, error: float, freedom: float) -> float:
    """Returns the one-sided p that a distance with this standard error is above zero. Values
    without any spread, as of a virtual run with fixed times, are certain."""
    if error == 0:
        return 0.0 if distance > 0 else 1.0
    return float(special.stdtr(min(freedom, ENDLESS), -distance / error))


def _parts(chains: Sequence[_Chain]) -> tuple[Part, ...]:
    if len(chains) < 2:
        return ()
    return tuple(
        Part("holds", chain.p_same)
        if chain.p_same <= LEVEL
        else Part("reversed", chain.p_apart)
        if chain.p_apart <= LEVEL
        else Part("not_shown", chain.p_same)
        for chain in chains
    )
