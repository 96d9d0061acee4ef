# SPDX-License-Identifier: Apache-2.0
"""Tests an experiment's metrics between its systems and between its links."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import pandas as pd

from slambed.metrics.catalog import keys_for
from slambed.metrics.comparison import USUAL_ALPHA, holm, runs_to_show
from slambed.metrics.metric import Metric, Use
from slambed.metrics.robust_accuracy import LEAST_COVERAGE
from slambed.report.cells import metrics_asked, text
from slambed.report.contrast import MetricContrast, contrast
from slambed.report.load import Results
from slambed.report.tables import Table, change_with_interval

SYSTEMS, LINKS = "label", "profile"
"""Columns of the runs that are compared."""
NO_LINK = "no link"


@dataclass(frozen=True)
class Difference:
    """One metric of one system (or link) against the baseline under equal conditions."""

    dataset: str
    under: str
    """The link if systems are compared, else the system."""
    metric: Metric
    baseline: str
    other: str
    found: MetricContrast
    p_value: float
    """Adjusted for all comparisons of the table (Holm)."""
    possible: bool = True
    """Whether this many runs could have shown any difference among so many comparisons."""

    @property
    def verdict(self) -> str:
        """Returns the result in words, which never claim equality."""
        if self.p_value > USUAL_ALPHA:
            return "no difference shown" if self.possible else "too few runs to show any"
        return self.metric.judged(self.found.change.value, "different")


def differences(
    results: Results, baseline: str | None = None, between: str = SYSTEMS
) -> list[Difference]:
    """Compares every system with the first one (or `baseline`) for the same dataset and link; with
    LINKS, every link with the first one for the same system and dataset. Where the first one of
    the experiment has no runs, it is the first one that has."""
    runs = results.valid_runs
    if not len(runs):
        return []
    numbers = results.numbers()
    asked = [key for key in metrics_asked(results) if key in numbers]
    metrics = [results.metric(key) for key in asked or keys_for(Use.TESTED)]
    found = [
        Difference(dataset, under, item, first, other, test, test.p_value)
        for dataset, under, first, other, a, b in _pairs(runs, between, baseline)
        for item in metrics
        if (test := contrast(item, a, b)) is not None
    ]
    if not found:
        return []
    adjusted = holm([item.p_value for item in found])
    return [
        replace(d, p_value=float(p), possible=_could_show(d, len(found)))
        for d, p in zip(found, adjusted, strict=True)
    ]


def _could_show(d: Difference, comparisons: int) -> bool:
    return d.found.least_p * comparisons <= USUAL_ALPHA


def _pairs(
    runs: pd.DataFrame, between: str, baseline: str | None
) -> Iterator[tuple[str, str, str, str, pd.DataFrame, pd.DataFrame]]:
    """Yields dataset, the equal link or system, baseline and other, and the runs of both."""
    fixed = LINKS if between == SYSTEMS else SYSTEMS
    named = runs[between].map(_name)
    # Live and virtual numbers are never compared with each other.
    for (engine, dataset, under), group in runs.groupby(
        ["engine", "dataset", fixed], sort=False, dropna=False
    ):
        own = named.loc[group.index]
        order = dict.fromkeys(named[runs["engine"].map(text) == text(engine)])
        there = [name for name in order if own.eq(name).any()]
        first = baseline if baseline in there else there[0]
        for other in there:
            if other != first:
                sides = group[own == first], group[own == other]
                yield text(dataset), _name(under), first, other, *sides


def _name(value: object) -> str:
    return text(value) or NO_LINK


def difference_tables(results: Results) -> list[Table]:
    """Returns the tables between systems and between links."""
    return [difference_table(differences(results, between=b), b) for b in (SYSTEMS, LINKS)]


def difference_table(found: list[Difference], between: str = SYSTEMS) -> Table:
    """Returns every tested difference, smallest p first; the caption has what the runs could
    show."""
    rows = [
        [
            d.dataset,
            d.under,
            d.metric.heading,
            d.baseline,
            d.other,
            d.metric.show(d.found.a),
            d.metric.show(d.found.b),
            change_with_interval(d.metric, d.found.change),
            d.found.effect,
            f"{d.found.runs}{' pairs' if d.found.paired else ''}",
            f"{d.p_value:.2g}",
            d.verdict,
        ]
        for d in sorted(found, key=lambda d: d.p_value)
    ]
    headings = [
        "dataset", "link" if between == SYSTEMS else "system", "metric", "baseline", "other",
        "baseline value", "other value", "change [95 %]", "effect", "runs", "p (Holm)", "verdict",
    ]  # fmt: skip
    name, what = (
        ("differences", "systems under equal conditions")
        if between == SYSTEMS
        else ("differences_links", "links, each system by itself")
    )
    caption = (
        f"Differences between {what}. Virtual runs are paired by their seed "
        "(Wilcoxon's signed-rank test, shares McNemar's exact test), live runs are not "
        "(Mann-Whitney's test with Cliff's delta, shares Fisher's exact test). Changes are median "
        "differences of two runs, in parentheses the range where runs are too few for an interval. "
        f"The ATE RMSE of a run that tracked less than {LEAST_COVERAGE:.0%} of its frames ranks "
        "last, as failed, unless all did"
    )
    return Table(name, caption + _power(found), headings, rows, words=5)


def _power(found: list[Difference]) -> str:
    """Returns how many runs the comparisons without enough runs would have needed."""
    blind = [d for d in found if not d.possible and d.p_value > USUAL_ALPHA]
    if not blind:
        return ""
    needed = max(runs_to_show(len(found), d.found.paired) for d in blind)
    fewest = min(d.found.runs for d in blind)
    return (
        f". With {fewest} runs {len(blind)} of these {len(found)} comparisons could show no "
        f"difference, however large; from {needed} runs per combination on they can"
    )
