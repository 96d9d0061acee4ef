# SPDX-License-Identifier: Apache-2.0
"""papers/*.yaml: published numbers, and how their coordinates are found in our results."""

from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from slambed.errors import SlambedError
from slambed.native import repository_root

STRICT = ConfigDict(extra="forbid", frozen=True)
Number = float | int
Match = dict[str, str | list[str]]
"""Column of summary.csv (or params.<name>) -> pattern or patterns; `*` stands for anything."""


class Source(BaseModel):
    """Where the numbers were published."""

    model_config = STRICT

    title: str
    authors: list[str]
    venue: str
    year: int


class PaperSystem(BaseModel):
    """A system as the paper calls it."""

    model_config = STRICT

    label: str
    match: Match


class PaperDataset(BaseModel):
    """A sequence as the paper calls it. A stand-in can show an ordering, never a reproduction."""

    model_config = STRICT

    label: str
    match: list[str]
    stand_in: list[str] = []
    note: str = ""


class PaperMetric(BaseModel):
    """Which number of ours a metric of the paper is put beside."""

    model_config = STRICT

    key: str
    """Key of summary.json, or `delay.<part>` / `tracking.<field>` computed from the events."""
    statistic: Literal["share", "mean", "median"]
    scale: float
    """Paper's unit = scale * our unit."""
    better: Literal["lower", "higher", "neither"]
    only_without_loss: bool = False
    per_second: bool = False
    note: str = ""


class Column(BaseModel):
    """A column of a published table."""

    model_config = STRICT

    label: str
    unit: str | None = None
    dims: dict[str, Any]


Value = Number | bool | str | list[Number]


class Row(BaseModel):
    """A row; a value is a number, or [number, printed spread]."""

    model_config = STRICT

    label: str
    metric: str
    unit: str
    dims: dict[str, Any]
    values: dict[str, Value]


class PublishedTable(BaseModel):
    """One table of a paper; full coordinates of a value = conditions + column dims + row dims."""

    model_config = STRICT

    id: str
    label: str
    where: str
    caption: str
    conditions: dict[str, Any]
    columns: dict[str, Column]
    rows: dict[str, Row]
    notes: list[str] = []


class PublishedFigure(BaseModel):
    """A data figure; no points were digitised."""

    model_config = STRICT

    id: str
    label: str
    where: str
    shows: str
    stated: list[str]


class Claim(BaseModel):
    """A sentence of the paper that states a number or an ordering."""

    model_config = STRICT

    id: str
    kind: Literal["result", "setup", "parameter", "background", "qualitative"]
    metric: str
    system: str | None
    conditions: dict[str, Any]
    op: Literal["eq", "approx", "le", "lt", "ge", "gt", "range", "set"] | None
    value: Number | str | list[Number] | None
    unit: str | None
    where: str
    recomputed: Number | None = None
    note: str = ""


class PeerRow(BaseModel):
    """Another program's figure for a key of summary.json, in our unit."""

    model_config = STRICT

    low: float
    value: float
    high: float
    target: float | None = None
    """The ratio ours / theirs that we aim at."""
    note: str = ""


class PeerSetup(BaseModel):
    """One way in which another program was measured."""

    model_config = STRICT

    label: str
    match: Match
    rows: dict[str, PeerRow]


class Paper(BaseModel):
    """One file of papers/."""

    model_config = STRICT

    id: str
    kind: Literal["paper", "peer"]
    paper: Source
    systems: dict[str, PaperSystem] = {}
    datasets: dict[str, PaperDataset] = {}
    conditions: dict[str, Any] = {}
    metrics: dict[str, PaperMetric] = {}
    tables: list[PublishedTable] = []
    figures: list[PublishedFigure] = []
    claims: list[Claim] = []
    setups: dict[str, PeerSetup] = Field(default={})

    def names(self) -> set[str]:
        """What an experiment may say it reproduces: the paper, its tables, figures and claims."""
        tables = {table.id for table in self.tables}
        figures = {figure.id for figure in self.figures}
        return {self.id} | tables | figures | {claim.id for claim in self.claims}

    def sources(self, names: set[str]) -> set[str]:
        """Tables and claims among `names`; a figure stands for the claims stated with it, the
        paper's own id for everything in it."""
        known = {table.id for table in self.tables} | {claim.id for claim in self.claims}
        if self.id in names:
            return known
        stated = {s for figure in self.figures if figure.id in names for s in figure.stated}
        return (names & known) | stated


def papers_folder() -> Path:
    """The papers/ of this checkout."""
    return repository_root() / "papers"


def read_paper(path: Path) -> Paper:
    """Raises SlambedError with file, key and reason when the file is not as described."""
    try:
        return Paper.model_validate(yaml.safe_load(path.read_text(encoding="utf-8")))
    except (OSError, yaml.YAMLError) as error:
        raise SlambedError(f"cannot read published numbers, {path}, {error}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise SlambedError(f"{first['msg'].lower()}, {path.name}: {where}") from error


def read_papers(names: list[str] | None = None) -> list[Paper]:
    """All papers, or those named; a wrong name lists the right ones."""
    files = {path.stem: path for path in sorted(papers_folder().glob("*.yaml"))}
    for name in names or []:
        if name not in files:
            known = ", ".join(files)
            raise SlambedError(f"no paper '{name}' in {papers_folder()}; known: {known}")
    return [read_paper(files[name]) for name in names or files]
