# SPDX-License-Identifier: Apache-2.0
"""The search: rounds of points, the likelihood of each, and which are kept.

It knows counts only, so that a test can put a known truth in the place of runs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from slambed.infer.design import Point
from slambed.infer.mixture import Counts, drawn_log_likelihoods, log_likelihood, weights_of
from slambed.papers.verdicts.model import Floats, Share

Evaluate = Callable[[Sequence[Point], int], Mapping[Point, Counts]]
"""(points, runs of every fitted cell) -> counts of each point. The same call gives the same."""
LEAST_CHANCE = 0.025
"""Of being kept with all its runs: below it a point gets no more. Halving the points by rank drops
good ones that were unlucky, and the intervals of what is left cover too little."""
DRAWS, DRAWS_SEED = 200, 20264


@dataclass(frozen=True)
class Evaluated:
    """A point with what its runs say of the fitted cells."""

    point: Point
    runs: int
    """Of every fitted cell."""
    counts: Counts
    log_likelihood: float


@dataclass
class FitResult:
    """All points that were looked at, each with the most runs it got."""

    printed: dict[str, Share]
    """The fitted cells as published."""
    within_log: float
    points: dict[Point, Evaluated] = field(default_factory=dict)
    unpaid: int = 0
    """Points that were not dropped and got no more runs, for the budget was spent."""

    def put(self, found: Mapping[Point, Counts], runs: int) -> None:
        """More runs of some points."""
        for point, counts in found.items():
            value = log_likelihood(counts, self.printed)
            self.points[point] = Evaluated(point, runs, counts, value)

    @property
    def ranked(self) -> list[Evaluated]:
        """The likeliest first; of equals the one that was drawn first."""
        return sorted(self.points.values(), key=lambda e: -e.log_likelihood)

    @property
    def best(self) -> Evaluated:
        """The likeliest."""
        return self.ranked[0]

    @property
    def kept(self) -> list[Evaluated]:
        """Those so near to the best that the fit cannot distinguish them."""
        least = self.best.log_likelihood - self.within_log
        return [e for e in self.ranked if e.log_likelihood >= least]

    @property
    def weights(self) -> Floats:
        """Of the kept points."""
        return weights_of([e.log_likelihood for e in self.kept])


def search(
    points: Sequence[Point],
    rounds: Sequence[int],
    printed: dict[str, Share],
    within_log: float,
    evaluate: Evaluate,
    allowed: Callable[[Sequence[Point], int], int] = lambda points, runs: len(points),
) -> FitResult:
    """Gives all points the runs of each round, but those that have become unlikely to be kept with
    the runs of the last one; then whoever is kept gets those too, until every kept point has them.

    `allowed`: how many of these points, the likeliest first, may have so many runs.
    """
    fit = FitResult(printed, within_log)
    alive, final = list(points), rounds[-1]
    for runs in rounds:
        chosen = alive[: allowed(alive, runs)]
        fit.unpaid += len(alive) - len(chosen)
        if not chosen:
            break
        fit.put(evaluate(chosen, runs), runs)
        alive = _likely(fit, chosen, final)
    while behind := [e.point for e in fit.kept if e.runs < final]:
        chosen = behind[: allowed(behind, final)]
        if not chosen:
            fit.unpaid += len(behind)
            break
        fit.put(evaluate(chosen, final), final)
    return fit


def _likely(fit: FitResult, points: Sequence[Point], final: int) -> list[Point]:
    """Those that may still be kept, the likeliest first."""
    generator = np.random.default_rng(DRAWS_SEED)
    own = [fit.points[point] for point in points]
    drawn = [drawn_log_likelihoods(e.counts, fit.printed, final, DRAWS, generator) for e in own]
    best = max(float(np.median(d)) for d in drawn)
    likely = [
        e
        for e, d in zip(own, drawn, strict=True)
        if (d >= best - fit.within_log).mean() >= LEAST_CHANCE
    ]
    return [e.point for e in sorted(likely, key=lambda e: -e.log_likelihood)]
