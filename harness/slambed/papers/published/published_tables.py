# SPDX-License-Identifier: Apache-2.0
"""Tables and figures of a paper."""

from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from slambed.papers.published.base import Number, Strict
from slambed.papers.published.braces import expanded
from slambed.papers.published.comparability import Comparability

Value = Number | bool | str | list[Number]


class Column(Strict):
    """A column of a published table."""

    label: str
    """Heading in the paper."""
    unit: str | None = None
    """Unit, where the column has its own."""
    dims: dict[str, Any]
    """Condition, system or metric -> value of the whole column."""


class Row(Comparability):
    """A row; a value is a number, or [number, printed spread]."""

    label: str
    """Heading in the paper."""
    metric: str
    """Key of `metrics`."""
    unit: str
    """Unit of its values."""
    dims: dict[str, Any]
    """Condition or system -> value of the whole row."""
    values: dict[str, Value]
    """Column -> printed value."""
    metrics: dict[str, str] = Field(default_factory=dict)
    """Maps a column to the metric, if neither row nor column alone names it."""
    runs: dict[str, int] = Field(default_factory=dict)
    """Maps a column to the runs behind its value, if they differ from the table's."""
    spread_of: Literal["runs", "rounds"] = "runs"
    """What the printed spread is over. The number of rounds is not printed."""


class PublishedTable(Comparability):
    """One table of a paper; full coordinates of a value = conditions + column dims + row dims."""

    id: str
    """Name, unique in the paper."""
    label: str
    """Name in the paper."""
    where: str
    """Place in the paper."""
    lines: list[int] = Field(default_factory=list)
    """Lines of the paper's plain text with the table."""
    caption: str
    """What it shows."""
    conditions: dict[str, Any]
    """Condition -> value of the whole table."""
    columns: dict[str, Column]
    """Name -> a column."""
    rows: dict[str, Row]
    """Name -> a row."""
    cells: dict[str, Comparability] = Field(default_factory=dict)
    """Maps `<row>.<column>` to the comparability of that cell alone."""
    notes: list[str] = Field(default_factory=list)
    """What a reader must know."""

    @model_validator(mode="after")
    def _names_agree(self) -> "PublishedTable":
        places = {f"{row}.{column}" for row in self.rows for column in self.rows[row].values}
        if unknown := set(self.cells) - places:
            raise ValueError(f"{self.id} has no cell {min(unknown)}")
        for name, row in self.rows.items():
            if unknown := (set(row.values) | set(row.metrics) | set(row.runs)) - set(self.columns):
                raise ValueError(f"{self.id}, row {name}: no column {min(unknown)}")
        return self


class Series(Strict):
    """Points along one condition of a figure or a sentence, for use in contrasts.

    Their ids are `<figure>.<series>.<value>`. `values` has the numbers that the paper prints; it is
    empty for a curve without printed numbers, because none are read off a plot.
    """

    label: str
    """Name of the curve in the paper."""
    metric: str
    """Key of `metrics`."""
    system: str
    """Key of `systems`."""
    conditions: dict[str, Any] = Field(default_factory=dict)
    """Condition -> value of the whole curve."""
    along: str
    """The condition that varies."""
    at: list[Number | str] = Field(min_length=1)
    """Values of that condition."""
    values: list[Number | None] = Field(default_factory=list)
    """Printed value of each point; null: not printed."""
    unmappable: str | None = None
    """Why no run of ours corresponds to these points."""

    @model_validator(mode="after")
    def _as_many(self) -> "Series":
        if self.values and len(self.values) != len(self.at):
            raise ValueError(f"{self.label}: as many values as places, or none")
        return self


class Drawn(Strict):
    """What the page draws from events of our runs, because the paper's figure shows single
    events."""

    kind: Literal["times", "distribution"]
    """times: a row per cell with a mark for each event of its first run. distribution: a curve per
    cell over all its runs, the share of events with at most this value."""
    event: str
    """Type of the event, as in events.jsonl."""
    field: str = ""
    """Field of the event with the value; of `distribution`."""
    unit: str
    """Unit of the horizontal axis."""
    only: dict[str, bool | str] = Field(default_factory=dict)
    """Field -> the value of the events that count."""
    cells: list[str] = Field(min_length=1)
    """Points of figures whose runs are drawn; braces stand for several, as in contrasts."""

    @field_validator("cells")
    @classmethod
    def _braces(cls, cells: list[str]) -> list[str]:
        return [one for cell in cells for one in expanded(cell)]

    @model_validator(mode="after")
    def _has_a_value(self) -> "Drawn":
        if (self.kind == "distribution") != bool(self.field):
            raise ValueError("a distribution needs the field with its value, times need none")
        return self


class PublishedFigure(Strict):
    """A data figure; no points were digitized."""

    id: str
    """Name, unique in the paper."""
    label: str
    """Name in the paper."""
    where: str
    """Place in the paper."""
    shows: str
    """What it shows, in one sentence."""
    stated: list[str]
    """Claims that state numbers of this figure in the text."""
    series: dict[str, Series] = Field(default_factory=dict)
    """Name -> points of one of its curves."""
    unmappable: str | None = None
    """Why nothing of it is compared."""
    drawn: Drawn | None = None
    """What the page draws of our runs in its place."""
