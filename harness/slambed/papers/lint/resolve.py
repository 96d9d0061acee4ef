# SPDX-License-Identifier: Apache-2.0
"""Checks without any run that the coordinates of a published number lead to our runs."""

from collections.abc import Iterator
from fnmatch import fnmatchcase
from typing import Any

from slambed.papers.published.cells import PublishedCell
from slambed.papers.published.paper import Paper


def unresolved(paper: Paper, cell: PublishedCell) -> Iterator[str]:
    """Yields a line for each coordinate without a counterpart."""
    if cell.metric not in paper.metrics:
        yield f"metric '{cell.metric}' has no number of ours: metrics, or unmappable: why?"
    if cell.system is None:
        yield "no system is named: unmappable?"
    elif cell.system not in paper.systems:
        yield f"system '{cell.system}' has no counterpart of ours: systems, or unmappable: why?"
    left = dict(cell.conditions)
    dataset = left.pop("dataset", None)
    if dataset is None:
        yield "no dataset is named: say which in read_as, or unmappable: why?"
    elif dataset not in paper.datasets:
        yield f"dataset '{dataset}' has no counterpart of ours: datasets, or unmappable: why?"
    for name, value in left.items():
        if not expressible(paper, cell.system, name, value):
            yield f"condition {name} = {value} cannot be expressed: conditions, or unmappable: why?"


def expressible(paper: Paper, system: str | None, name: str, value: Any) -> bool:
    """Returns whether a condition selects runs, or is marked as irrelevant (`ignore`)."""
    rule = paper.conditions.get(name)
    if rule == "ignore":
        return True
    if not isinstance(rule, dict):
        return False
    if "column" in rule:
        only = rule.get("systems")
        applies = not only or any(fnmatchcase(str(system), pattern) for pattern in only)
        return not applies or isinstance(value, int | float)
    return value in rule or "*" in rule
