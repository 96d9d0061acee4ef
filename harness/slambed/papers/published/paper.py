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
    authors: list[str]
    venue: str
    year: int

    @property
    def published(self) -> str:
        """Returns venue and year; a journal's venue may already end with the year."""
        ends_with_it = self.venue.endswith(f" {self.year}")
        return self.venue if ends_with_it else f"{self.venue}, {self.year}"


class Paper(Strict):
    """One file papers/<id>/paper.yaml."""

    id: str
    kind: Literal["paper", "peer"]
    paper: Source
    systems: dict[str, PaperSystem] = Field(default_factory=dict)
    datasets: dict[str, PaperDataset] = Field(default_factory=dict)
    conditions: dict[str, Any] = Field(default_factory=dict)
    metrics: dict[str, PaperMetric] = Field(default_factory=dict)
    margins: dict[str, Margin] = Field(default_factory=dict)
    tables: list[PublishedTable] = Field(default_factory=list)
    figures: list[PublishedFigure] = Field(default_factory=list)
    claims: list[Claim] = Field(default_factory=list)
    contrasts: list[Contrast] = Field(default_factory=list)
    setups: dict[str, PeerSetup] = Field(default_factory=dict)

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
