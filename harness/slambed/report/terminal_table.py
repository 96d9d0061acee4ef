# SPDX-License-Identifier: Apache-2.0
"""A table in a terminal: no word of a number column is broken, whatever the width."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal, Protocol

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions
from rich.table import Table
from rich.text import Text

BETWEEN = 2
"""Characters between two columns."""
LEAST_NAME = 16
"""Width down to which a name is folded. It is never cut: its end may distinguish two cells."""


class Content(Protocol):
    """What is shown; the first `words` columns are text, and the others are numbers."""

    caption: str
    headings: list[str]
    rows: list[list[str]]
    words: int


@dataclass(frozen=True)
class TerminalTable:
    """Shows a table that is too wide as several, each with the text columns."""

    content: Content

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Text | Table]:
        if self.content.caption:
            # As the table's own title it would be wrapped at the width of a narrow table.
            yield Text(self.content.caption, style="table.title")
        for columns in self.parts(options.max_width):
            yield self._part(columns, options.max_width)

    def parts(self, width: int) -> list[list[int]]:
        """Returns the columns of each table."""
        texts = list(range(self.content.words))
        found: list[list[int]] = [texts]
        for column in range(self.content.words, len(self.content.headings)):
            longer = [*found[-1], column]
            if found[-1] != texts and _total(map(self._least, longer)) > width:
                longer = [*texts, column]
                found.append(longer)
            found[-1] = longer
        return found

    def _part(self, columns: list[int], width: int) -> Table:
        table = Table(box=None, pad_edge=False)
        widths = self._widths(columns, width)
        for column in columns:
            is_text = column < self.content.words
            justify: Literal["left", "right"] = "left" if is_text else "right"
            heading = Text(self.content.headings[column])
            table.add_column(heading, justify=justify, overflow="fold", width=widths.get(column))
        for row in self.content.rows:
            table.add_row(*(Text(row[column]) for column in columns))
        return table

    def _widths(self, columns: list[int], width: int) -> dict[int, int]:
        """Returns the width of each column; none if the terminal is too narrow for one number."""
        widths = {column: self._least(column) for column in columns}
        room = width - _total(widths.values())
        if room < 0:
            return {}
        # Cells on one line are easier to compare than headings on one line.
        for texts_of in (self._cells, self._all):
            wanted = {column: max(map(cell_len, texts_of(column)), default=0) for column in columns}
            # Text first: once one number of a row has two lines, the others may have them, too.
            for column in sorted(columns, key=lambda c: (c >= self.content.words, wanted[c])):
                more = min(room, max(0, wanted[column] - widths[column]))
                widths[column] += more
                room -= more
        return widths

    def _least(self, column: int) -> int:
        kept = (text.replace(" ± ", "_±_") for text in self._all(column))
        words = (word for text in kept for word in text.split())
        longest = max(map(cell_len, words), default=1)
        return min(longest, LEAST_NAME) if column < self.content.words else longest

    def _cells(self, column: int) -> list[str]:
        return [row[column] for row in self.content.rows]

    def _all(self, column: int) -> list[str]:
        return [self.content.headings[column], *self._cells(column)]


def _total(widths: Iterable[int]) -> int:
    found = list(widths)
    return sum(found) + BETWEEN * (len(found) - 1)
