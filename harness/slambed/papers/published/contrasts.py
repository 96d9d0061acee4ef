# SPDX-License-Identifier: Apache-2.0
"""Declared orderings of a paper; only these are judged as orderings."""

from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from slambed.papers.published.base import Strict
from slambed.papers.published.braces import expanded
from slambed.papers.published.quantities import Direction

ContrastKind = Literal["pair", "trend", "all_below", "blocks", "flat"]


class Contrast(Strict):
    """An ordering between cells, declared before the runs.

    pair: two cells. trend: three or more cells along one condition. all_below: in every chain the
    first cell is below the second; the statement holds only as a whole. blocks: chains of equal
    length, one per block (for example a sequence), with the same order in each (Page's L). flat:
    one chain or several, in each of which every two cells are equal within the metric's margin.
    """

    id: str
    """Name, unique in the paper."""
    kind: ContrastKind
    """Shape of the ordering."""
    cells: list[str] | list[list[str]] = Field(min_length=1)
    """Ids of cells, claims or points of figures: one chain, or (all_below, blocks, flat) several.

    Braces expand to several ids. In a single chain they expand in place (`T2.x.rtt{0,20}` is two
    cells), and so they do in a chain of one text. In other lists of chains they expand to as many
    chains, in step if several cells have braces.
    """
    direction: Direction | None = None
    """Direction of the value along each chain, in the given order; `flat` has none."""
    where: str
    """Place in the paper."""
    lines: list[int] = Field(default_factory=list)
    """Lines of the paper's plain text with the statement."""
    says: str
    """The statement in one sentence, for the page."""
    basis: Literal["data", "text"] = "data"
    """data: it counts only if the paper's own numbers show it; text: the paper describes or plots
    it, without numbers to test."""
    main: bool = False
    """True for a main claim, shown at the top of the paper's page."""
    claims: list[str] = Field(default_factory=list)
    """Recorded claims that this ordering judges."""
    note: str = ""
    """What a reader must know."""

    @property
    def chains(self) -> list[list[str]]:
        """Returns the cells as a list of ordered chains."""
        return (
            [[c for c in self.cells if isinstance(c, str)]]
            if self._one
            else [list(c) for c in self.cells if isinstance(c, list)]
        )

    @property
    def _one(self) -> bool:
        return isinstance(self.cells[0], str)

    def ids(self) -> list[str]:
        """Returns every cell of the ordering once, in order."""
        return list(dict.fromkeys(cell for chain in self.chains for cell in chain))

    @field_validator("cells", mode="before")
    @classmethod
    def _braces(cls, cells: Any) -> Any:
        if not isinstance(cells, list):
            return cells
        if all(isinstance(cell, str) for cell in cells):
            return [one for cell in cells for one in expanded(cell)]
        return [one for chain in cells for one in _in_step(chain)]

    @model_validator(mode="after")
    def _shape(self) -> "Contrast":
        chains = self.chains
        lengths = {len(chain) for chain in chains}
        if self.kind != "flat" and self._one != (self.kind in ("pair", "trend")):
            raise ValueError(f"{self.id}: {self.kind} has another shape of cells")
        if (self.direction is None) != (self.kind == "flat"):
            raise ValueError(f"{self.id}: every kind but flat has a direction")
        if self.kind == "flat" and (min(lengths) < 2 or self.basis != "text"):
            raise ValueError(f"{self.id}: flat is said of two or more cells, basis text")
        if self.kind in ("pair", "all_below") and lengths != {2}:
            raise ValueError(f"{self.id}: {self.kind} compares two cells at a time")
        if self.kind == "trend" and min(lengths) < 3:
            raise ValueError(f"{self.id}: a trend needs three cells, two are a pair")
        if self.kind == "blocks" and (len(lengths) > 1 or min(lengths) < 2 or len(chains) < 2):
            raise ValueError(f"{self.id}: blocks are two or more chains of equal length")
        if self.kind == "all_below" and self.direction != "rises":
            raise ValueError(f"{self.id}: all_below rises from the first cell to the second")
        if any(len(set(chain)) != len(chain) for chain in chains):
            raise ValueError(f"{self.id}: a cell stands twice in a chain")
        return self


def _in_step(chain: list[str]) -> list[list[str]]:
    if len(chain) == 1:
        return [expanded(chain[0])]
    columns = [expanded(cell) for cell in chain]
    count = max(len(column) for column in columns)
    if any(len(column) not in (1, count) for column in columns):
        raise ValueError(f"cells of {chain} stand for different numbers of cells")
    return [[column[min(index, len(column) - 1)] for column in columns] for index in range(count)]
