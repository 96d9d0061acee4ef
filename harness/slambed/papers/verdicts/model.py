# SPDX-License-Identifier: Apache-2.0
"""What goes into a verdict and what comes out: plain values, no file, no run, no paper."""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

Outcome = Literal["reproduced", "differs", "inconclusive", "not_run"]
"""What is said of a published number."""
OrderOutcome = Literal[
    "holds", "reversed", "not_seen", "too_few_runs", "inconclusive", "not_shown_by_paper"
]
"""What is said of a published ordering. One that ours do not show is `not_seen` where it would have
shown (`SEEN_POWER`), `too_few_runs` where it might not have, and `inconclusive` where the paper
prints nothing to report that by."""
Scale = Literal["points", "ratio", "difference"]
"""Effects: difference of shares, log ratio of means, difference of means in their unit."""

FEWEST_RUNS = 5
"""Below this nothing is decided, whatever the interval: one odd run would be a fifth of it."""
MOST_RUNS = 300
"""What a campaign can be asked for per cell; margins that want more leave a cell to orderings."""
ASSUMED_COUNT = 5
"""Runs behind a published mean that does not say how many (flagged)."""
SEEN_POWER = 0.9
"""Chance to see an ordering as the paper prints it, from which on not to see it says something."""
LEVEL = 0.05
"""Of every test: one-sided for equivalence and orderings, two-sided for a difference."""


@dataclass(frozen=True)
class Share:
    """`bad` of `runs` runs."""

    bad: int
    runs: int

    @property
    def value(self) -> float:
        """0 to 1; NaN of no runs."""
        return self.bad / self.runs if self.runs else float("nan")


@dataclass(frozen=True)
class Mean:
    """A mean as printed or measured; what is None was not printed.

    `digit` is the last printed digit (0.1 of 36.3), 0 for a measured mean.
    """

    value: float
    sd: float | None = None
    count: int | None = None
    digit: float = 0.0

    @classmethod
    def of(cls, values: ArrayLike) -> Self:
        """Mean and sample standard deviation of measured values."""
        array = np.asarray(values, dtype=np.float64)
        if not len(array):
            return cls(float("nan"), None, 0)
        sd = float(array.std(ddof=1)) if len(array) > 1 else None
        return cls(float(array.mean()), sd, len(array))

    @property
    def cv(self) -> float | None:
        """Coefficient of variation, where mean and spread are there."""
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
    """Runs per cell that would decide if what was seen so far is true; None: no number would."""
    assumed: tuple[str, ...] = ()
    """What the paper does not print and was put in for it."""

    @property
    def bound(self) -> float:
        """The margin as it is on the axis of the effect."""
        return float(np.log1p(self.margin)) if self.scale == "ratio" else self.margin


def not_run(why: str) -> Verdict:
    """Nothing to judge."""
    return Verdict("not_run", why)


def too_few(runs: int, scale: Scale, needed: int | None) -> Verdict:
    """One to four runs: never decided."""
    return Verdict(
        "inconclusive",
        f"{runs} {'run is' if runs == 1 else 'runs are'} too few, {FEWEST_RUNS} are the least",
        scale=scale,
        runs_needed=needed,
    )


RUN_COUNTS = (5, 10, 15, 20, 30, 40, 50, 75, 100, 150, 200, 300, 500, 750, 1000, 2000)
"""Numbers of runs that are offered as an answer to `how many would decide`."""
