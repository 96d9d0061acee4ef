# SPDX-License-Identifier: Apache-2.0
"""Trends over a history of nights: every gated metric of every cell over commits, and its changes.

Each night is judged by the rule of the regression gate against the nights since the last change. So
a step is marked once, at the commit first measured with it (as in asv), and not every night after.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from slambed.errors import SlambedError
from slambed.metrics.catalog import keys_for, metric
from slambed.metrics.metric import Metric, Use
from slambed.metrics.statistics import Interval
from slambed.regression.gate import BASELINE_NIGHTS, HISTORY_COLUMNS, judge, stored_table
from slambed.regression.nights import comparable
from slambed.report.cells import estimate, text
from slambed.report.metrics_versions import own_metrics_in

STEP_ALPHA = 0.005
"""Chance of a false mark per night, for each direction. The gate's own level (0.05) would give
false marks over many nights."""
MOST_NIGHTS = 120
"""Older nights are left out of the page, but stay in the history."""


@dataclass(frozen=True)
class Point:
    """A metric of a cell in one night."""

    night: str
    commit: str
    value: Interval
    passed: bool
    """Whether that night passed the regression gate."""


@dataclass(frozen=True)
class Step:
    """A change of a metric, and the p value that shows it (Holm over the night)."""

    night: str
    commit: str
    experiment: str
    cell: str
    metric: Metric
    before: float
    after: float
    worse: bool
    p_value: float


@dataclass
class Trend:
    """One metric of one cell."""

    metric: Metric
    points: list[Point] = field(default_factory=list)
    steps: list[Step] = field(default_factory=list)


@dataclass
class ExperimentTrends:
    """The history of an experiment, cell by cell."""

    name: str
    nights: list[str]
    cells: dict[str, list[Trend]]

    @property
    def steps(self) -> list[Step]:
        """Returns all changes, latest first."""
        found = [s for trends in self.cells.values() for trend in trends for s in trend.steps]
        return sorted(found, key=lambda step: (step.night, -step.p_value), reverse=True)


def read_history(path: Path) -> pd.DataFrame:
    """Reads a history. Raises SlambedError if there is none, or if it is no history of the
    regression gate."""
    if not path.is_file():
        begin = f"slambed gate NAME --first-night --history {path}"
        raise SlambedError(f"no history {path}; '{begin}' begins one")
    return stored_table(path, HISTORY_COLUMNS)


def trends_of(history: pd.DataFrame) -> list[ExperimentTrends]:
    """Returns the trends by experiment, sorted by name."""
    return [
        _experiment(str(name), rows)
        for name, rows in history.groupby("experiment", sort=True)
        if rows["valid"].eq(True).any()
    ]


def _experiment(name: str, rows: pd.DataFrame) -> ExperimentTrends:
    nights = sorted(rows["night_utc"].astype(str).unique())[-MOST_NIGHTS:]
    own = own_metrics_in(rows)
    items = [metric(key, own) for key in keys_for(Use.GATED, own) if key in rows]
    found: dict[str, dict[str, Trend]] = {}
    for night in nights:
        tonight = rows[rows["night_utc"].eq(night)]
        for cell, some in tonight[tonight["valid"].eq(True)].groupby("cell", sort=False):
            for item in items:
                if (value := estimate(some, item)) is not None:
                    trend = found.setdefault(str(cell), {}).setdefault(item.key, Trend(item))
                    trend.points.append(_point(night, some, value))
    for step in _steps(name, rows, nights):
        found[step.cell][step.metric.key].steps.append(step)
    cells = {cell: list(trends.values()) for cell, trends in sorted(found.items())}
    return ExperimentTrends(name, nights, cells)


def _point(night: str, some: pd.DataFrame, value: Interval) -> Point:
    passed = bool(some["passed"].eq(True).all()) if "passed" in some else True
    return Point(night, _commit(some), value, passed)


def _commit(some: pd.DataFrame) -> str:
    """Returns the commit of a night; nights of older versions have none."""
    return text(some["commit"].iloc[0]) if "commit" in some else ""


def _steps(name: str, rows: pd.DataFrame, nights: list[str]) -> Iterator[Step]:
    """Compares each night cell by cell with those before it, back to the cell's last change."""
    begins: dict[tuple[str, str], int] = {}
    """Maps cell and metric to the index of the first night of its baseline."""
    for index, night in enumerate(nights[1:], start=1):
        tonight = rows[rows["night_utc"].eq(night)]
        by_begin: dict[int, list[tuple[str, str]]] = {}
        for cell in tonight.loc[tonight["valid"].eq(True), "cell"].unique():
            for key in keys_for(Use.GATED, own_metrics_in(tonight)):
                place = (str(cell), key)
                begin = max(begins.get(place, 0), index - BASELINE_NIGHTS)
                by_begin.setdefault(begin, []).append(place)
        for begin, places in by_begin.items():
            before = rows[rows["night_utc"].isin(nights[begin:index])]
            for step in _changes(name, before, tonight, places):
                begins[step.cell, step.metric.key] = index
                yield step


def _changes(
    name: str, before: pd.DataFrame, tonight: pd.DataFrame, places: list[tuple[str, str]]
) -> Iterator[Step]:
    """Yields what the gate's rule calls worse tonight, and with sides swapped, better tonight."""
    before, _ = comparable(before, tonight)
    keys = sorted({key for _, key in places})
    for worse in (True, False):
        sides = (before, tonight) if worse else (tonight, before)
        for finding in judge(*sides, STEP_ALPHA, keys).findings:
            place = (finding.cell, finding.metric.key)
            if not finding.alarm or place not in places:
                continue
            ends = (finding.baseline, finding.tonight)
            old, new = ends if worse else ends[::-1]
            yield Step(
                str(tonight["night_utc"].iloc[0]),
                _commit(tonight),
                name,
                finding.cell,
                finding.metric,
                old,
                new,
                worse,
                finding.p_value,
            )
