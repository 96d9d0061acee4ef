# SPDX-License-Identifier: Apache-2.0
"""papers/<id>/paper.yaml: published numbers, and how their coordinates map to our results."""

from typing import Any, Literal

from pydantic import Field

from slambed.papers.published.base import Strict
from slambed.papers.published.claims import Claim
from slambed.papers.published.contrasts import Contrast
from slambed.papers.published.mapping import Margin, PaperDataset, PaperMetric, PaperSystem
from slambed.papers.published.peer import PeerSetup
from slambed.papers.published.published_tables import PublishedFigure, PublishedTable


class Source(Strict):
    """Where the numbers were published."""

    title: str
    """Title of the publication."""
    authors: list[str]
    """In the printed order."""
    venue: str
    """Where it was published."""
    year: int
    """When it was published."""

    @property
    def published(self) -> str:
        """Returns venue and year; a journal's venue may already end with the year."""
        ends_with_it = self.venue.endswith(f" {self.year}")
        return self.venue if ends_with_it else f"{self.venue}, {self.year}"


class Paper(Strict):
    """One file papers/<id>/paper.yaml."""

    id: str
    """Name, as of the folder."""
    kind: Literal["paper", "peer"]
    """`paper`: a publication; `peer`: another program, measured by us."""
    paper: Source
    """The publication, or the other program."""
    systems: dict[str, PaperSystem] = Field(default_factory=dict)
    """Name in this file -> a system of the paper."""
    datasets: dict[str, PaperDataset] = Field(default_factory=dict)
    """Name in this file -> a sequence of the paper."""
    conditions: dict[str, Any] = Field(default_factory=dict)
    """Condition -> how its values are found in our runs: `ignore`, a column with the value, or for
    each value what a run must match. `{pool: {column: [a, b]}}` instead stands for a mean over
    equally many runs of each."""
    metrics: dict[str, PaperMetric] = Field(default_factory=dict)
    """Name in this file -> a metric of the paper."""
    margins: dict[str, Margin] = Field(default_factory=dict)
    """Metric -> how far from the printed value still reproduces it."""
    tables: list[PublishedTable] = Field(default_factory=list)
    """Tables with their numbers."""
    figures: list[PublishedFigure] = Field(default_factory=list)
    """Figures of data."""
    claims: list[Claim] = Field(default_factory=list)
    """Sentences that state a number or an ordering."""
    contrasts: list[Contrast] = Field(default_factory=list)
    """Orderings to be judged."""
    setups: dict[str, PeerSetup] = Field(default_factory=dict)
    """Name -> one measurement of another program; of `kind: peer`."""

    def names(self) -> set[str]:
        """Returns the names that an experiment can reproduce: the paper, its tables, figures and
        claims."""
        tables = {table.id for table in self.tables}
        figures = {figure.id for figure in self.figures}
        return {self.id} | tables | figures | {claim.id for claim in self.claims}

    def sources(self, names: set[str]) -> set[str]:
        """Returns tables, figures and claims among `names`. A figure includes the claims stated
        with it; the paper's own id includes everything."""
        known = self.names() - {self.id}
        if self.id in names:
            return known
        stated = {s for figure in self.figures if figure.id in names for s in figure.stated}
        return (names & known) | stated
