# SPDX-License-Identifier: Apache-2.0
"""The search: evaluates points in rounds and keeps the likely ones.

It uses counts only, so that a test can replace runs with a known truth.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from slambed.infer.design import Point
from slambed.infer.mixture import Counts, drawn_log_likelihoods, log_likelihood, weights_of
from slambed.papers.verdicts.model import Floats, Share

Evaluate = Callable[[Sequence[Point], int], Mapping[Point, Counts]]
"""Maps (points, runs of every fitted cell) to counts of each point; deterministic."""
LEAST_CHANCE = 0.025
"""A point whose chance of being kept after all runs is below this gets no more runs. Halving the
points by rank would drop good points by bad luck, and the intervals of the rest would cover too
little."""
DRAWS, DRAWS_SEED = 200, 20264


@dataclass(frozen=True)
class Evaluated:
    """A point with its counts of the fitted cells."""

    point: Point
    runs: int
    """Runs of every fitted cell."""
    counts: Counts
    log_likelihood: float


@dataclass
class FitResult:
    """All points tried, each with its largest number of runs."""

    printed: dict[str, Share]
    """The fitted cells as published."""
    within_log: float
    points: dict[Point, Evaluated] = field(default_factory=dict)
    unpaid: int = 0
    """Points that were still likely but got no more runs because the budget was spent."""

    def put(self, found: Mapping[Point, Counts], runs: int) -> None:
        """Stores the counts of points after `runs` runs."""
        for point, counts in found.items():
            value = log_likelihood(counts, self.printed)
            self.points[point] = Evaluated(point, runs, counts, value)

    @property
    def ranked(self) -> list[Evaluated]:
        """Returns the points by falling likelihood; ties keep the order in which they were
        drawn."""
        return sorted(self.points.values(), key=lambda e: -e.log_likelihood)

    @property
    def best(self) -> Evaluated:
        return self.ranked[0]

    @property
    def kept(self) -> list[Evaluated]:
        """Returns the points within `within_log` of the best, which the fit cannot distinguish."""
        least = self.best.log_likelihood - self.within_log
        return [e for e in self.ranked if e.log_likelihood >= least]

    @property
    def weights(self) -> Floats:
        return weights_of([e.log_likelihood for e in self.kept])


def search(
    points: Sequence[Point],
    rounds: Sequence[int],
    printed: dict[str, Share],
    within_log: float,
    evaluate: Evaluate,
    allowed: Callable[[Sequence[Point], int], int] = lambda points, runs: len(points),
) -> FitResult:
    """Gives points the runs of each round and drops those that are unlikely to be kept after the
    last one. Then it completes the runs of kept points until every kept point has them all.
    `allowed` returns how many of these points, likeliest first, may have so many runs.

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
    """Returns the points that may still be kept, the likeliest first."""
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
