# SPDX-License-Identifier: Apache-2.0
"""papers/<id>/paper.yaml: published numbers, and how their coordinates are found in our results."""

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
        """Venue and year; a venue that ends with its date, as journals print it, has the year."""
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
        """What an experiment may say it reproduces: the paper, its tables, figures and claims."""
        tables = {table.id for table in self.tables}
        figures = {figure.id for figure in self.figures}
        return {self.id} | tables | figures | {claim.id for claim in self.claims}

    def sources(self, names: set[str]) -> set[str]:
        """Tables, figures and claims among `names`; a figure stands for the claims stated with it
        too, the paper's own id for everything in it."""
        known = self.names() - {self.id}
        if self.id in names:
            return known
        stated = {s for figure in self.figures if figure.id in names for s in figure.stated}
        return (names & known) | stated
