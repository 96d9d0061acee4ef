# SPDX-License-Identifier: Apache-2.0
"""Lists every place of a paper that a number of ours can be compared with, under one id."""

from dataclasses import dataclass, field
from typing import Any

from slambed.metrics.catalog import SUMMARY_KEYS, metric
from slambed.papers.published.claims import Claim
from slambed.papers.published.comparability import Comparability
from slambed.papers.published.mapping import PaperMetric
from slambed.papers.published.paper import Paper
from slambed.papers.published.published_tables import PublishedTable, Row, Value

PER_COLUMN = "per_column"
"""Marks a row's metric or unit as given by its columns."""


@dataclass(frozen=True)
class PublishedCell:
    """A cell of a table, a point of a figure or a claim, with its full coordinates."""

    id: str
    """`<table>.<row>.<column>`, `<figure>.<series>.<value>` or the claim's id."""
    source: str
    """The table, figure or claim that it belongs to."""
    row: str
    column: str
    metric: str
    unit: str
    value: float | None
    """As printed; None if the paper prints no number."""
    spread: float | None = None
    resolution: float | None = None
    """The last printed digit, in the paper's unit."""
    system: str | None = None
    conditions: dict[str, Any] = field(default_factory=dict)
    """Dataset and varied conditions, in the paper's terms."""
    runs: int | None = None
    """Number of the paper's runs behind it, if printed."""
    comparability: Comparability = field(default_factory=Comparability)
    claim: Claim | None = None

    @property
    def coordinates(self) -> dict[str, Any]:
        """Returns metric, system and conditions in one mapping."""
        return {**self.conditions, "system": self.system, "metric": self.metric}


def cells_of(paper: Paper) -> dict[str, PublishedCell]:
    """Returns all cells, points and claims of a paper by id. Text and flags are included without a
    value."""
    found = [cell for table in paper.tables for cell in _of_table(table)]
    found += [cell for cell in _of_figures(paper)]
    found += [_of_claim(claim) for claim in paper.claims]
    return {cell.id: cell for cell in found}


def table_cells(paper: Paper) -> dict[str, PublishedCell]:
    return {cell.id: cell for table in paper.tables for cell in _of_table(table)}


def _of_table(table: PublishedTable) -> list[PublishedCell]:
    return [
        _of_row(table, name, row, column, value)
        for name, row in table.rows.items()
        for column, value in row.values.items()
    ]


def _of_row(table: PublishedTable, name: str, row: Row, column: str, value: Value) -> PublishedCell:
    heading = table.columns[column]
    coordinates = {**table.conditions, **heading.dims, **row.dims}
    metric = str(coordinates.pop("metric", row.metrics.get(column, row.metric)))
    system = coordinates.pop("system", None)
    number, spread = _number(value)
    alone = table.cells.get(f"{name}.{column}", Comparability())
    runs = row.runs.get(column, table.conditions.get("runs"))
    if row.spread_of != "runs":
        runs = None
    return PublishedCell(
        id=f"{table.id}.{name}.{column}",
        source=table.id,
        row=row.label,
        column=heading.label,
        metric=column if metric == PER_COLUMN else metric,
        unit=(heading.unit if row.unit == PER_COLUMN else row.unit) or "",
        value=number,
        spread=spread,
        resolution=resolution_of(value),
        system=system,
        conditions=coordinates,
        runs=runs if isinstance(runs, int) else None,
        comparability=alone.over(row).over(table),
    )


def _unit_of(mapped: PaperMetric | None) -> str:
    """Returns the unit of a paper's metric, as far as that of ours says it."""
    if mapped is None or mapped.key not in SUMMARY_KEYS:
        return ""
    if mapped.statistic == "share" and mapped.scale == 100:
        return "%"
    return metric(mapped.key).unit if mapped.scale == 1 else ""


def _of_figures(paper: Paper) -> list[PublishedCell]:
    found = []
    for figure in paper.figures:
        for name, series in figure.series.items():
            for index, at in enumerate(series.at):
                value = series.values[index] if series.values else None
                found.append(
                    PublishedCell(
                        id=f"{figure.id}.{name}.{at}",
                        source=figure.id,
                        row=series.label,
                        column=f"{series.along} {at}",
                        metric=series.metric,
                        unit=_unit_of(paper.metrics.get(series.metric)),
                        value=None if value is None else float(value),
                        resolution=resolution_of(value),
                        system=series.system,
                        conditions={**series.conditions, series.along: at},
                        comparability=Comparability(
                            unmappable=series.unmappable or figure.unmappable
                        ),
                    )
                )
    return found


def _of_claim(claim: Claim) -> PublishedCell:
    number, _ = _number(None if isinstance(claim.value, list) else claim.value)
    runs = claim.conditions.get("runs")
    return PublishedCell(
        id=claim.id,
        source=claim.id,
        row=claim.metric,
        column=claim.system or "",
        metric=claim.metric,
        unit=claim.unit or "",
        value=number,
        resolution=resolution_of(claim.value),
        system=claim.system,
        conditions=dict(claim.conditions),
        runs=runs if isinstance(runs, int) else None,
        comparability=claim,
        claim=claim,
    )


def _number(value: Value | None) -> tuple[float | None, float | None]:
    """Returns a printed number and its spread; None for text and flags."""
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return None, None
    if isinstance(value, list):
        return (float(value[0]), float(value[1])) if len(value) == 2 else (None, None)
    return float(value), None


def resolution_of(value: Value | None) -> float | None:
    """Returns the unit of the last printed digit, 0.1 for 36.3; None for text and flags."""
    if isinstance(value, list):
        value = value[0] if value else None
    if value is None or isinstance(value, bool | str):
        return None
    text = str(value)
    return 10.0 ** -len(text.partition(".")[2]) if "." in text and "e" not in text else 1.0
