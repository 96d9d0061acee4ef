# SPDX-License-Identifier: Apache-2.0
"""Input and output of verdicts, as plain values without files, runs or papers."""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

Outcome = Literal["reproduced", "differs", "inconclusive", "not_run"]
"""Verdict on a published number."""
OrderOutcome = Literal[
    "holds", "reversed", "not_seen", "too_few_runs", "inconclusive", "not_shown_by_paper"
]
"""Verdict on a published ordering. If our runs do not show it: `not_seen` if they would have
(`SEEN_POWER`), `too_few_runs` if they might not have, `inconclusive` if the paper prints no numbers
to compute that."""
Scale = Literal["points", "ratio", "difference"]
"""Effect scales: difference of shares, log ratio of means, difference of means in their unit."""

FEWEST_RUNS = 5
"""Below this nothing is decided, whatever the interval: a single outlier would be over a fifth of
the runs."""
MOST_RUNS = 300
"""Most runs per cell of a campaign; a cell whose margin needs more is judged by its orderings."""
ASSUMED_COUNT = 5
"""Assumed runs behind a published mean without a printed number of runs (flagged)."""
SEEN_POWER = 0.9
"""Power from which on it is informative that an ordering of the printed size is not seen."""
LEVEL = 0.05
"""Level of every test: one-sided for equivalence and orderings, two-sided for a difference."""


@dataclass(frozen=True)
class Share:
    """`bad` of `runs` runs."""

    bad: int
    runs: int

    @property
    def value(self) -> float:
        """Returns the share, 0 to 1; NaN without runs."""
        return self.bad / self.runs if self.runs else float("nan")


@dataclass(frozen=True)
class Mean:
    """A mean as printed or measured; a None was not printed.

    `digit` is the last printed digit (0.1 of 36.3), 0 for a measured mean.
    """

    value: float
    sd: float | None = None
    count: int | None = None
    digit: float = 0.0

    @classmethod
    def of(cls, values: ArrayLike) -> Self:
        """Returns mean and sample standard deviation of measured values."""
        array = np.asarray(values, dtype=np.float64)
        if not len(array):
            return cls(float("nan"), None, 0)
        sd = float(array.std(ddof=1)) if len(array) > 1 else None
        return cls(float(array.mean()), sd, len(array))

    @property
    def cv(self) -> float | None:
        """Returns the coefficient of variation; None without a spread or with a mean of 0."""
        if self.sd is None or self.value == 0:
            return None
        return abs(self.sd / self.value)


@dataclass(frozen=True)
class Verdict:
    """The outcome of one comparison with everything that led to it.

    `effect`, `low`, `high` (95 % interval) and `margin` are on `scale`; a margin of 0.2 on the
    scale `ratio` stands for ln 1.2 both ways.
    """

    outcome: Outcome
    why: str
    formula: str = ""
    scale: Scale = "points"
    effect: float = float("nan")
    low: float = float("nan")
    high: float = float("nan")
    margin: float = float("nan")
    runs_needed: int | None = None
    """Runs per cell that would decide if the results so far are true; None if no number would."""
    assumed: tuple[str, ...] = ()
    """Values that the paper does not print and that were assumed."""

    @property
    def bound(self) -> float:
        """Returns the margin on the axis of the effect."""
        return float(np.log1p(self.margin)) if self.scale == "ratio" else self.margin


def not_run(why: str) -> Verdict:
    """Returns the verdict without anything to judge."""
    return Verdict("not_run", why)


def too_few(runs: int, scale: Scale, needed: int | None) -> Verdict:
    """Returns the verdict for one to four runs, which never decide."""
    return Verdict(
        "inconclusive",
        f"{runs} {'run is' if runs == 1 else 'runs are'} too few, {FEWEST_RUNS} are the least",
        scale=scale,
        runs_needed=needed,
    )


RUN_COUNTS = (5, 10, 15, 20, 30, 40, 50, 75, 100, 150, 200, 300, 500, 750, 1000, 2000)
"""Candidate numbers of runs for `runs_needed`."""
