# SPDX-License-Identifier: Apache-2.0
"""papers/*/paper.yaml: published numbers, how we read them, and how to find ours."""

from slambed.papers.published.base import Match, Provenance
from slambed.papers.published.cells import PublishedCell, cells_of, table_cells
from slambed.papers.published.claims import BOUNDS, Claim, Operator
from slambed.papers.published.comparability import Comparability, Erratum
from slambed.papers.published.contrasts import Contrast
from slambed.papers.published.mapping import Margin, PaperDataset, PaperMetric, PaperSystem
from slambed.papers.published.paper import Paper, Source
from slambed.papers.published.paper_plan import PaperPlan, frozen_digest, read_plan
from slambed.papers.published.peer import PeerRow, PeerSetup
from slambed.papers.published.published_tables import (
    Column,
    PublishedFigure,
    PublishedTable,
    Row,
    Series,
)
from slambed.papers.published.quantities import (
    At,
    Difference,
    Each,
    EventTimes,
    Gap,
    Increase,
    MaxOver,
    Operand,
    Quantity,
    Ratio,
    Reduction,
    Trend,
    WindowShare,
)
from slambed.papers.published.reading import paper_files, papers_folder, read_paper, read_papers

__all__ = [
    "BOUNDS",
    "At",
    "Claim",
    "Column",
    "Comparability",
    "Contrast",
    "Difference",
    "Each",
    "Erratum",
    "EventTimes",
    "Gap",
    "Increase",
    "Margin",
    "Match",
    "MaxOver",
    "Operand",
    "Operator",
    "Paper",
    "PaperDataset",
    "PaperMetric",
    "PaperPlan",
    "PaperSystem",
    "PeerRow",
    "PeerSetup",
    "Provenance",
    "PublishedCell",
    "PublishedFigure",
    "PublishedTable",
    "Quantity",
    "Ratio",
    "Reduction",
    "Row",
    "Series",
    "Source",
    "Trend",
    "WindowShare",
    "cells_of",
    "frozen_digest",
    "paper_files",
    "papers_folder",
    "read_paper",
    "read_papers",
    "read_plan",
    "table_cells",
]  # fmt: skip
