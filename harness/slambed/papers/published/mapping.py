# SPDX-License-Identifier: Apache-2.0
"""Maps the names of a paper to our results."""

from typing import Literal

from pydantic import Field, model_validator

from slambed.papers.published.base import Match, Strict


class PaperSystem(Strict):
    """A system of the paper."""

    label: str
    """Name of the system in the paper."""
    match: Match
    """Key of a run -> values by which its runs are found."""
    not_built: str | None = None
    """Why there is no such system yet; `match` then tells how its runs will be found."""


class PaperDataset(Strict):
    """A sequence of the paper. A substitute can show an ordering, but never a reproduction."""

    label: str
    """Name of the sequence in the paper."""
    match: list[str]
    """Datasets whose runs are runs on this sequence."""
    stand_in: list[str] = Field(default_factory=list)
    """Names in catalog/datasets/, best first; only runs of one of them are used."""
    played_s: float | None = Field(default=None, gt=0)
    """Seconds of it that the paper plays: a share of runs with a loss needs equal exposure."""
    each_sequence_once: bool = False
    """True for several sequences: each contributes its own mean, whatever its number of runs. Does
    not apply to a substitute."""
    note: str = ""
    """What a reader must know."""


class OtherReading(Strict):
    """Another metric of ours that fits the paper's definition equally well."""

    key: str
    """Key of summary.json."""
    note: str
    """What the other reading is."""
    excluded: bool = False
    """True if the paper's own numbers rule it out: it is shown, but does not prevent
    `reproduced`."""


class PaperMetric(Strict):
    """Our counterpart of a metric of the paper."""

    key: str
    """Key of summary.json, or `delay.<part>` / `tracking.<field>` computed from the events."""
    plus: list[str] = Field(default_factory=list)
    """Further keys whose values are added for each run; only beside a key of summary.json."""
    only: Match = Field(default_factory=dict)
    """Runs that it can be taken from, in addition to the coordinates."""
    reference: str | None = None
    """The paper's system whose runs are the reference path: on the same sequence, and under those
    of the number's conditions that it has."""
    statistic: Literal["share", "mean", "median"]
    """What is taken over the runs of a cell."""
    scale: float
    """Paper's unit = scale * our unit."""
    better: Literal["lower", "higher", "neither"]
    """Which direction is better."""
    only_without_loss: bool = False
    """Only runs that never lost track count."""
    needs_exposure: bool = False
    """True if it grows with the time played, so that runs of another length cannot be compared."""
    other_readings: list[OtherReading] = Field(default_factory=list)
    """Shown together with ours. As long as one is not excluded, the verdict cannot be
    `reproduced`."""
    read_as: str | None = None
    """How we read the paper's definition if it is ambiguous."""
    note: str = ""
    """What a reader must know."""


class Margin(Strict):
    """How far ours may be from a published number and still reproduce it; written before the runs.

    Keys of `margins:` are the paper's metrics, and `about` and `reduction` for reductions and
    ratios of any metric. Other statements have fixed margins (docs/explanation/verdicts.md).
    """

    ratio: float | None = Field(default=None, gt=0, lt=1)
    """Symmetric in the ratio: 0.2 allows ln(ours / paper) within -/+ ln(1.2)."""
    points: float | None = Field(default=None, gt=0)
    """Absolute, in the paper's unit: percentage points of a share."""
    points_at_ends: float | None = Field(default=None, gt=0)
    """Used instead of `points` if the paper prints at most 5 or at least 95 %."""

    @model_validator(mode="after")
    def _ratio_or_points(self) -> "Margin":
        if (self.ratio is None) == (self.points is None):
            raise ValueError("a margin is either a ratio or points")
        if self.points_at_ends is not None and self.points is None:
            raise ValueError("points_at_ends needs points")
        return self

    def at(self, published: float) -> float:
        """Returns the margin for one published value: a fraction of it (`ratio`) or points."""
        if self.ratio is not None:
            return self.ratio
        assert self.points is not None
        at_an_end = published <= END_PERCENT or published >= 100 - END_PERCENT
        if self.points_at_ends is not None and at_an_end:
            return self.points_at_ends
        return self.points


END_PERCENT = 5.0
"""Shares this close to 0 or 100 % vary less, so their margin can be narrower."""
