# SPDX-License-Identifier: Apache-2.0
"""Replaces codes of numbers and orderings (C07, O03) by what they stand for, for readers who do not
have paper.yaml at hand."""

import re
from collections.abc import Mapping

from slambed.papers.published import Paper, PublishedCell, cells_of

CODE = re.compile(r"\b(?:([a-z]+)\.)?([A-Z]\d{1,2})((?:\.[A-Za-z0-9_]+)*)\b")
"""`C07`, `ijnc.C07`, or a cell of a table as `dynnet.T5.static.office`."""


def spelled(text: str, paper: Paper) -> str:
    """Returns the text with every code of this paper after its sentence: `"Both schemes together
    are the most accurate" (O06)`. Words that only look like a code stay."""
    if not CODE.search(text):
        return text
    cells = cells_of(paper)
    says = {item.id: item.says for item in paper.contrasts}
    prefix = next(iter([*says, *cells]), "").partition(".")[0]

    def words(found: re.Match[str]) -> str:
        name = f"{found[1] or prefix}.{found[2]}{found[3]}"
        if name in says:
            return f'"{says[name]}" ({found[2]})'
        if name in cells:
            return _words(cells[name], paper, found[2])
        return found[0]

    return CODE.sub(words, text)


def named(cell: PublishedCell, systems: Mapping[str, str]) -> str:
    """Returns what a number is, in words: row and column of a table, or metric and system."""
    if cell.claim is None:
        return ", ".join(w for w in (cell.row, cell.column) if w)
    metric = cell.metric.replace("_", " ")
    system = systems.get(cell.system or "", "")
    return f"{metric}, {system}" if system else metric


def _words(cell: PublishedCell, paper: Paper, code: str) -> str:
    systems = {name: system.label for name, system in paper.systems.items()}
    if cell.claim is not None:
        return f'"{named(cell, systems)}" ({code})'
    labels = {table.id: table.label for table in paper.tables}
    return f"{labels.get(cell.source, code)} ({named(cell, systems)})"
