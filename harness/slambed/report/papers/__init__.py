# SPDX-License-Identifier: Apache-2.0
"""papers/*/paper.yaml: published numbers, how they are read, and where ours are found."""

from slambed.report.papers.base import Match, Provenance
from slambed.report.papers.cells import Cell, cells_of, table_cells
from slambed.report.papers.claims import BOUNDS, Claim, Operator
from slambed.report.papers.contrasts import Contrast
from slambed.report.papers.mapping import Margin, PaperDataset, PaperMetric, PaperSystem
from slambed.report.papers.paper import Paper, Source
from slambed.report.papers.peer import PeerRow, PeerSetup
from slambed.report.papers.plan import PaperPlan, frozen_digest, read_plan
from slambed.report.papers.quantities import (
    At,
    Difference,
    Each,
    Increase,
    MaxOver,
    Operand,
    Quantity,
    Ratio,
    Reduction,
    Trend,
    WindowShare,
)
from slambed.report.papers.reading import paper_files, papers_folder, read_paper, read_papers
from slambed.report.papers.standing import Erratum, Standing
from slambed.report.papers.tables import Column, PublishedFigure, PublishedTable, Row, Series

__all__ = [
    "BOUNDS", "At", "Cell", "Claim", "Column", "Contrast", "Difference", "Each", "Erratum",
    "Increase", "Margin", "Match", "MaxOver", "Operand", "Operator", "Paper", "PaperDataset",
    "PaperMetric", "PaperPlan", "PaperSystem", "PeerRow", "PeerSetup", "Provenance",
    "PublishedFigure", "PublishedTable", "Quantity", "Ratio", "Reduction", "Row", "Series",
    "Source", "Standing", "Trend", "WindowShare", "cells_of", "frozen_digest", "paper_files",
    "papers_folder", "read_paper", "read_papers", "read_plan", "table_cells",
]  # fmt: skip
