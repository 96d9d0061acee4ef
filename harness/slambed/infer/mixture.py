# SPDX-License-Identifier: Apache-2.0
"""Predicts a published number from several points: a mixture of their predictions.

Each point predicts by the rules of papers/verdicts/prediction.py and is weighted by its likelihood.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize

from slambed.papers.verdicts.model import Floats, Mean, Share
from slambed.papers.verdicts.prediction import (
    EXPECTED,
    inside,
    mean_position,
    mean_spread,
    share_log_likelihood,
    share_positions,
)

Counts = Mapping[str, Share]
"""Maps a published number to the losses in our runs."""
REACH = 40.0
"""Standard deviations from the outermost mean within which every quantile lies."""


def log_likelihood(ours: Counts, printed: Counts) -> float:
    """Returns the log-likelihood of the printed counts if the paper's runs were like ours, summed
    over all printed cells."""
    cells = list(printed)
    if not cells:
        return 0.0
    return float(
        share_log_likelihood(
            [ours[c].bad for c in cells],
            [ours[c].runs for c in cells],
            [printed[c].bad for c in cells],
            [printed[c].runs for c in cells],
        ).sum()
    )


def drawn_log_likelihoods(
    ours: Counts, printed: Counts, final: int, draws: int, generator: np.random.Generator
) -> Floats:
    """Draws the log-likelihood that may result from `final` runs, given the runs so far. Shape:
    (draws,)."""
    cells = list(printed)
    bad = np.array([ours[c].bad for c in cells])
    runs = np.array([ours[c].runs for c in cells])
    shares = generator.beta(bad + 0.5, runs - bad + 0.5, (draws, len(cells)))
    more = np.maximum(final - runs, 0)
    found = share_log_likelihood(
        bad + generator.binomial(more, shares),
        runs + more,
        [printed[c].bad for c in cells],
        [printed[c].runs for c in cells],
    )
    return np.asarray(found.sum(axis=1))


def best_possible(printed: Counts, runs: int) -> float:
    """Returns the log-likelihood of runs whose shares are the printed ones, as close as counts
    allow."""
    ours = {c: Share(round(runs * s.value), runs) for c, s in printed.items()}
    return log_likelihood(ours, printed)


def weights_of(log_likelihoods: Sequence[float]) -> Floats:
    """Returns the weights of points under a uniform prior; they sum to 1."""
    values = np.asarray(log_likelihoods, dtype=np.float64)
    found = np.exp(values - values.max())
    return np.asarray(found / found.sum())


@dataclass(frozen=True)
class Prediction:
    """The prediction of one published number, in its own unit (counts: runs)."""

    expected: float
    low: float
    high: float
    """Ends of the central 95 %."""
    position: float
    """Quantile of the published number, 0 to 1."""

    @property
    def inside(self) -> bool:
        """Returns whether the published number is in the central 95 %."""
        return inside(self.position)


def predict_share(ours: Sequence[Share], weights: Floats, printed: Share) -> Prediction:
    """Predicts a published count. The interval spans the counts that would be judged as inside."""
    bad = np.array([s.bad for s in ours])[:, None]
    runs = np.array([s.runs for s in ours])[:, None]
    counts = np.arange(printed.runs + 1)
    positions = weights @ share_positions(bad, runs, counts[None, :], printed.runs)
    within = [int(c) for c in counts if inside(float(positions[c]))]
    shares = (bad + 0.5) / (runs + 1)
    expected = float(weights @ shares[:, 0] * printed.runs)
    position = float(positions[printed.bad])
    return Prediction(expected, float(within[0]), float(within[-1]), position)


def predict_mean(ours: Sequence[Mean], weights: Floats, printed: Mean) -> Prediction | None:
    """Predicts a published mean; None if one of the points has no spread."""
    spreads = [mean_spread(mean, printed) for mean in ours]
    known = [s for s in spreads if s is not None]
    if len(known) < len(ours):
        return None
    means = np.array([mean.value for mean in ours])

    def position(value: float) -> float:
        at = replace(printed, value=value)
        return float(weights @ [float(mean_position(m, at) or 0.0) for m in ours])

    reach = REACH * max(*known, 1e-9)
    ends = (float(means.min()) - reach, float(means.max()) + reach)
    tail = (1 - EXPECTED) / 2
    low, high = (
        float(optimize.brentq(lambda v, q=q: position(v) - q, *ends)) for q in (tail, 1 - tail)
    )
    return Prediction(float(weights @ means), low, high, position(printed.value))
