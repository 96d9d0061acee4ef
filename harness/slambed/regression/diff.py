# SPDX-License-Identifier: Apache-2.0
"""`slambed diff`: compares two results folders, or two parts of one, by metric and cell, in pairs
where seeds allow it.

The two may differ in commit, engine, system or host.
"""

from dataclasses import asdict, dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any

import pandas as pd

from slambed.errors import SlambedError
from slambed.files.outputs import writing
from slambed.metrics.catalog import keys_for, numbers_of
from slambed.metrics.comparison import USUAL_ALPHA, holm
from slambed.metrics.metric import Metric, Use
from slambed.metrics.statistics import Interval
from slambed.regression.diff_sides import Side, Sides
from slambed.report.cells import metrics_asked
from slambed.report.contrast import contrast
from slambed.report.tables import Table, change_with_interval, check_format
from slambed.suggestion import suggestion

MOST_LINES = 8
"""Most lines about what was not compared."""


@dataclass(frozen=True)
class Change:
    """One metric of one cell in both folders."""

    cell: str
    metric: Metric
    a: float
    b: float
    change: Interval
    """b - a: the median difference of two runs (of pairs if paired), or of the shares."""
    p_value: float
    """Adjusted for all comparisons of the two folders (Holm)."""
    paired: bool
    least_p: float
    """The smallest p value that so many runs can give, not adjusted."""
    possible: bool = True
    """Whether this many runs could have shown any change among so many comparisons."""

    @property
    def shown(self) -> bool:
        """Returns whether the change is significant."""
        return self.p_value <= USUAL_ALPHA

    @property
    def verdict(self) -> str:
        """Returns the result in words, which never claim equality."""
        if not self.shown:
            return "no change shown" if self.possible else "too few runs to show any"
        return self.metric.judged(self.change.value, "changed")


def diff(sides: Sides, metrics: list[str] | None = None) -> list[Change]:
    """Compares every metric that both experiments name (or `metrics`) in every cell that both have.

    Raises SlambedError if nothing matches.
    """
    a, b = sides.a.results, sides.b.results
    shared = set(a.numbers()) & set(b.numbers()) & set(metrics_asked(b))
    asked = metrics or [key for key in metrics_asked(a) if key in shared]
    for key in metrics or []:
        _must_be_known(key, sides)
    items = [a.metric(key) for key in asked or keys_for(Use.TESTED)]
    found = [
        change
        for cell, own, other in sides.matched()
        for item in items
        if (change := _change(cell, item, own, other)) is not None
    ]
    if not found:
        raise SlambedError(
            f"nothing to compare: {_words(sides.a)} and {_words(sides.b)} share no combination "
            "with two valid runs on either side; 'slambed status NAME' says what is there"
        )
    adjusted = holm([item.p_value for item in found])
    return [
        replace(c, p_value=float(p), possible=c.least_p * len(found) <= USUAL_ALPHA)
        for c, p in zip(found, adjusted, strict=True)
    ]


@dataclass(frozen=True)
class LeftOut:
    """A cell that only one side has, or one metric of a cell that was asked for."""

    cell: str
    metric: str | None
    """None for the whole cell."""
    why: str


def not_compared(
    found: list[Change], sides: Sides, metrics: list[str] | None = None
) -> list[LeftOut]:
    """Returns what `diff` left out: cells without a valid run on one side, and of `metrics` those
    that fewer than two runs (or pairs) have."""
    left_out = [
        LeftOut(cell, None, f"{letter} has no valid run of it") for cell, letter in sides.alone()
    ]
    compared = {(change.cell, change.metric.key) for change in found}
    for cell, _, _ in sides.matched():
        for key in dict.fromkeys(metrics or []):
            if (cell, key) not in compared:
                name = sides.a.results.metric(key).name
                why = f"{name}: fewer than two runs (or pairs) of a side have it"
                left_out.append(LeftOut(cell, key, why))
    return left_out


def left_out_lines(left_out: list[LeftOut]) -> list[str]:
    """Returns the first of them in words, and how many more there are."""
    lines = [f"not compared: {one.cell}: {one.why}" for one in left_out[:MOST_LINES]]
    more = len(left_out) - MOST_LINES
    return [*lines, f"not compared: {more} more; all with --json"] if more > 0 else lines


def _must_be_known(key: str, sides: Sides) -> None:
    """Raises SlambedError for a metric that neither side can have."""
    owns = (side.results.own_metrics.values() for side in (sides.a, sides.b))
    known = numbers_of(item for own in owns for item in own)
    if key not in known:
        raise SlambedError(f"unknown metric '{key}'; {suggestion(key, known)}")


def _words(side: Side) -> str:
    return " ".join([str(side.results.folder), *(f"({text})" for text in side.asked)])


def _change(cell: str, item: Metric, a: pd.DataFrame, b: pd.DataFrame) -> Change | None:
    found = contrast(item, a, b)
    if found is None:
        return None
    change = found.change
    return Change(cell, item, found.a, found.b, change, found.p_value, found.paired, found.least_p)


TESTS = (
    "Virtual runs of equal seed are pairs (Wilcoxon's signed-rank test, shares McNemar's), others "
    "are not (Mann-Whitney's, shares Fisher's)"
)


def diff_table(found: list[Change], sides: Sides) -> Table:
    """Returns the table, with the smallest p value first."""
    rows = [
        [
            c.cell,
            c.metric.heading,
            c.metric.show(c.a),
            c.metric.show(c.b),
            change_with_interval(c.metric, c.change),
            f"{c.change.count}{' pairs' if c.paired else ''}",
            f"{c.p_value:.2g}",
            c.verdict,
        ]
        for c in sorted(found, key=lambda c: c.p_value)
    ]
    headings = ["cell", "metric", *sides.headings(), "B - A [95 %]", "runs", "p (Holm)", "verdict"]
    lines = [*sides.lines, TESTS]
    if any(c.change.is_range for c in found):
        lines.append("In parentheses the range, where runs are too few for an interval")
    return Table("diff", "\n".join(lines), headings, rows, words=2)


def write_diff(table: Table, sides: Sides, path: Path) -> None:
    """Writes the table with descriptions of A and B. In .csv these are columns, and headings are
    always the same for scripts; in .md they are above the table."""
    check_format(path)
    with writing(path):
        if path.suffix == ".md":
            above = "".join(f"{line}\n\n" for line in sides.lines)
            path.write_text(above + table.markdown())
            return
        headings = [*table.headings[:2], "A", "B", *table.headings[4:], "A is", "B is"]
        rows = [[*row, *sides.descriptions] for row in table.rows]
        path.write_text(Table(table.name, table.caption, headings, rows, table.words).csv())


def diff_json(
    found: list[Change], sides: Sides, left_out: list[LeftOut] | None = None
) -> dict[str, Any]:
    """Returns the changes for scripts, in stored units; null where a failed run makes a number
    infinite."""

    def number(value: float) -> float | None:
        return value if isfinite(value) else None

    changes = [
        {
            "cell": c.cell,
            "metric": c.metric.key,
            "unit": c.metric.unit,
            "a": number(c.a),
            "b": number(c.b),
            "change": number(c.change.value),
            "low": number(c.change.low),
            "high": number(c.change.high),
            "is_range": c.change.is_range,
            "runs": c.change.count,
            "paired": c.paired,
            "p_value": number(c.p_value),
            "shown": c.shown,
            "verdict": c.verdict,
        }
        for c in sorted(found, key=lambda c: c.p_value)
    ]
    both = {"a": sides.a, "b": sides.b}
    return {
        **{letter: str(side.results.folder) for letter, side in both.items()},
        "sides": {
            letter: {"name": name, "selected": list(side.asked), **side.facts}
            for (letter, side), name in zip(both.items(), sides.names, strict=True)
        },
        "differing": sides.differing,
        "shown": sum(c.shown for c in found),
        "changes": changes,
        "not_compared": [asdict(one) for one in left_out or []],
    }
