# SPDX-License-Identifier: Apache-2.0
"""How the names of a paper are found in our results."""

from typing import Literal

from pydantic import Field, model_validator

from slambed.papers.published.base import Match, Strict


class PaperSystem(Strict):
    """A system as the paper calls it."""

    label: str
    """Name of the system in the paper."""
    match: Match
    """Key of a run -> values by which its runs are found."""
    not_built: str | None = None
    """Why there is no such system yet; `match` then says how its runs will be found."""


class PaperDataset(Strict):
    """A sequence as the paper calls it. A stand-in can show an ordering, never a reproduction."""

    label: str
    """Name of the sequence in the paper."""
    match: list[str]
    """Datasets whose runs are runs on this sequence."""
    stand_in: list[str] = Field(default_factory=list)
    """Names of catalog/datasets/, best first; runs of one only are used, never of two together."""
    played_s: float | None = Field(default=None, gt=0)
    """How much of it the paper plays: a share of runs with a loss needs equal exposure."""
    each_sequence_once: bool = False
    """It is several sequences: the mean of the sequences' own values, however many runs each."""
    note: str = ""
    """What a reader must know."""


class OtherReading(Strict):
    """A second number of ours that the paper's words may mean just as well."""

    key: str
    """Key of summary.json."""
    note: str
    """What the other reading is."""
    excluded: bool = False
    """The paper's own numbers rule it out: it is shown, and keeps nothing from being reproduced."""


class PaperMetric(Strict):
    """Which number of ours a metric of the paper is put beside."""

    key: str
    """Key of summary.json, or `delay.<part>` / `tracking.<field>` computed from the events."""
    plus: list[str] = Field(default_factory=list)
    """Further keys that are added to it, run by run."""
    only: Match = Field(default_factory=dict)
    """Which runs it can be taken from, whatever the coordinates."""
    reference: str | None = None
    """The paper's system whose runs under the same conditions are the path to compare with."""
    statistic: Literal["share", "mean", "median"]
    """What is taken over the runs of a cell."""
    scale: float
    """Paper's unit = scale * our unit."""
    better: Literal["lower", "higher", "neither"]
    """Which direction is better."""
    only_without_loss: bool = False
    """Only runs that never lost track count."""
    needs_exposure: bool = False
    """Grows with the time played: runs of another length than the paper's cannot be compared."""
    other_readings: list[OtherReading] = Field(default_factory=list)
    """Shown beside ours. While there is one that is not excluded, neither is called reproduced."""
    read_as: str | None = None
    """How we read the paper's definition where it is open."""
    note: str = ""
    """What a reader must know."""


class Margin(Strict):
    """How far ours may be from a published number and still reproduce it. Written before the runs.

    Keys of `margins:` are the paper's metrics, and `about` and `reduction` for statements of that
    kind whatever their metric.
    """

    ratio: float | None = Field(default=None, gt=0, lt=1)
    """Symmetric in the ratio: 0.2 lets ln(ours / paper) be within -/+ ln(1.2)."""
    points: float | None = Field(default=None, gt=0)
    """Absolute, in the paper's unit: percentage points of a share."""
    points_at_ends: float | None = Field(default=None, gt=0)
    """Instead of `points` where the paper prints at most 5 or at least 95 %."""

    @model_validator(mode="after")
    def _ratio_or_points(self) -> "Margin":
        if (self.ratio is None) == (self.points is None):
            raise ValueError("a margin is either a ratio or points")
        if self.points_at_ends is not None and self.points is None:
            raise ValueError("points_at_ends needs points")
        return self

    def at(self, published: float) -> float:
        """The margin for one published value: a part of it (`ratio`) or points."""
        if self.ratio is not None:
            return self.ratio
        assert self.points is not None
        at_an_end = published <= END_PERCENT or published >= 100 - END_PERCENT
        if self.points_at_ends is not None and at_an_end:
            return self.points_at_ends
        return self.points


END_PERCENT = 5.0
"""Shares this near to 0 or 100 % vary less, so their margin can be narrower."""
