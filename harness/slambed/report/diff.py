# SPDX-License-Identifier: Apache-2.0
"""`slambed diff A B`: two results folders, metric by metric, cell by cell, paired where seeds pair.

Whatever differs between the two: the commit, the engine, the system, the host.
"""

from dataclasses import dataclass

import pandas as pd

from slambed.errors import SlambedError
from slambed.metrics.catalog import keys_for
from slambed.metrics.comparison import USUAL_ALPHA, holm, least_p
from slambed.metrics.metric import Metric, Use
from slambed.metrics.statistics import Interval
from slambed.report.cells import metrics_asked, text
from slambed.report.contrast import contrast
from slambed.report.load import Results
from slambed.report.tables import Table, around

WHERE = ("label", "dataset", "profile")


@dataclass(frozen=True)
class Change:
    """One metric of one cell in both folders."""

    cell: str
    metric: Metric
    a: float
    b: float
    change: Interval
    """b - a: the median difference of two runs (of pairs, where there are), or of the shares."""
    p_value: float
    """Adjusted for all comparisons of the two folders (Holm)."""
    paired: bool
    possible: bool
    """Whether this many runs could have shown any change among so many comparisons."""

    @property
    def shown(self) -> bool:
        """True where chance does not explain it."""
        return self.p_value <= USUAL_ALPHA

    @property
    def verdict(self) -> str:
        """In words; equality is never claimed."""
        if not self.shown:
            return "no change shown" if self.possible else "too few runs to show any"
        if self.metric.better == "neither" or self.change.value == 0:
            return "changed"
        return "better" if (self.change.value > 0) == (self.metric.better == "higher") else "worse"


def diff(a: Results, b: Results, metrics: list[str] | None = None) -> list[Change]:
    """Every metric that both were asked for (or those named) in every cell that both have.

    Cells match by system's label, dataset and link; folders of one system each by the latter two.
    Raises SlambedError where nothing matches.
    """
    by = _matching(a.trusted, b.trusted)
    asked = metrics or [key for key in metrics_asked(a) if key in metrics_asked(b)]
    items = [a.metric(key) for key in asked or keys_for(Use.TESTED)]
    others = {_key(key): group for key, group in b.trusted.groupby(by, sort=False, dropna=False)}
    found: list[Change] = []
    for key, group in a.trusted.groupby(by, sort=False, dropna=False):
        if (other := others.get(_key(key))) is None:
            continue
        cell = "/".join(word for word in _key(key) if word)
        found += [c for item in items if (c := _change(cell, item, group, other)) is not None]
    if not found:
        raise SlambedError(
            f"nothing to compare: {a.folder} and {b.folder} share no cell with two runs to be "
            "trusted on either side; 'slambed status' says what is there"
        )
    adjusted = holm([item.p_value for item in found])
    return [
        Change(c.cell, c.metric, c.a, c.b, c.change, float(p), c.paired,
               least_p(c.change.count, c.paired) * len(found) <= USUAL_ALPHA)
        for c, p in zip(found, adjusted, strict=True)
    ]  # fmt: skip


def _matching(a: pd.DataFrame, b: pd.DataFrame) -> list[str]:
    labels = [set(side["label"].dropna().astype(str)) for side in (a, b)]
    one_each = all(len(names) == 1 for names in labels)
    return list(WHERE[1:] if one_each else WHERE)


def _key(key: object) -> tuple[str, ...]:
    return tuple(text(word) for word in (key if isinstance(key, tuple) else (key,)))


def _change(cell: str, item: Metric, a: pd.DataFrame, b: pd.DataFrame) -> Change | None:
    found = contrast(item, a, b)
    if found is None:
        return None
    return Change(cell, item, found.a, found.b, found.change, found.p_value, found.paired, True)


def diff_table(found: list[Change], a: str, b: str) -> Table:
    """The shown changes first."""
    rows = [
        [
            c.cell, c.metric.heading, c.metric.show(c.a), c.metric.show(c.b),
            f"{c.metric.show(c.change.value)} {around(c.metric, c.change)}",
            f"{c.change.count}{' pairs' if c.paired else ''}", f"{c.p_value:.2g}", c.verdict,
        ]
        for c in sorted(found, key=lambda c: c.p_value)
    ]  # fmt: skip
    headings = ["cell", "metric", "A", "B", "B - A [95 %]", "runs", "p (Holm)", "verdict"]
    caption = (
        f"A: {a}; B: {b}. Virtual runs of equal seed are pairs (Wilcoxon's signed-rank test, "
        "shares McNemar's), others are not (Mann-Whitney's, shares Fisher's)"
    )
    return Table("diff", caption, headings, rows, words=2)
