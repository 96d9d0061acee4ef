# SPDX-License-Identifier: Apache-2.0
"""`slambed bisect`: finds the first commit between a good and a bad one that fails the regression
gate."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import pandas as pd

from slambed.errors import SlambedError
from slambed.metrics.catalog import keys_for
from slambed.metrics.metric import Use
from slambed.regression.gate import ALPHA, judge
from slambed.report.load import Results
from slambed.suggestion import suggestion

State = Literal["good", "bad", "skipped"]
Notify = Callable[[str], None]


@dataclass(frozen=True)
class Commit:
    """A commit of the repository."""

    sha: str
    subject: str

    @property
    def short(self) -> str:
        """Returns the short hash, which is also the name of its folder."""
        return self.sha[:12]

    def __str__(self) -> str:
        return f"{self.short} {self.subject}"


class SkippedError(Exception):
    """A commit that cannot be measured: it does not build, or its harness does not run it."""


class Measures(Protocol):
    """Provides the runs of commits."""

    def measure(self, commit: Commit) -> Results:
        """Returns the runs of a commit and executes missing ones. Raises SkippedError."""


@dataclass
class Bisected:
    """The result; `first` is empty if nothing got worse."""

    first: list[Commit] = field(default_factory=list)
    """The first bad commit; several if commits before it were skipped."""
    why: list[str] = field(default_factory=list)
    """What got worse between the good and the bad end."""
    skipped: dict[str, str] = field(default_factory=dict)
    """Maps a commit hash to why it could not be measured."""
    tried: int = 0


@dataclass
class RegressionRule:
    """The regression gate's rule for commits instead of nights: runs of equal seed are pairs, and a
    change counts if it is significant and relevant."""

    good: Results
    metrics: list[str]
    """Only these metrics; empty for all gated ones."""
    alpha: float = ALPHA

    def __post_init__(self) -> None:
        if not len(self.good.valid_runs):
            raise SlambedError(
                "the good commit has no valid run, so nothing can be worse than it: "
                f"{self.good.problems[0] if self.good.problems else 'name another one'}"
            )
        own = self.good.own_metrics
        known = [key for key in self.good.numbers() if self.good.metric(key).better != "neither"]
        for key in self.metrics:
            if key not in known:
                advice = suggestion(key, known)
                raise SlambedError(f"no metric '{key}' that can get worse; {advice}")
        asked = self.metrics or keys_for(Use.GATED, own)
        if not any(_measured(self.good.valid_runs, key) for key in asked):
            names = ", ".join(self.metrics) or "nothing that the regression gate looks at"
            raise SlambedError(f"{names} was not measured at the good commit; name another metric")

    def worse(self, commit: Results) -> list[str]:
        """Returns why a commit would fail the gate; empty if it would pass."""
        return judge(self.good.runs, commit.runs, self.alpha, self.metrics).failures


def bisect(
    good: Commit,
    candidates: Sequence[Commit],
    measures: Measures,
    metrics: list[str],
    alpha: float = ALPHA,
    notify: Notify = lambda line: None,
) -> Bisected:
    """Finds the first bad commit of `candidates`: the commits after `good` in order, up to and
    including the bad end.

    Raises SlambedError if one of the ends cannot be measured.
    """
    found = Bisected()
    rule = RegressionRule(_end(good, measures, "good"), metrics, alpha)
    notify(f"good {good}: {len(rule.good.valid_runs)} runs")
    if not candidates:
        return found
    found.why = rule.worse(_end(candidates[-1], measures, "bad"))
    found.tried = 1 + (candidates[-1].sha != good.sha)
    if not found.why:
        notify(f"good {candidates[-1]}: no change for the worse shown")
        return found
    _report(notify, "bad ", candidates[-1], found.why)
    states: dict[int, State] = {-1: "good", len(candidates) - 1: "bad"}
    while (place := _next(states, len(candidates))) is not None:
        commit = candidates[place]
        found.tried += 1
        try:
            why = rule.worse(measures.measure(commit))
        except SkippedError as error:
            states[place] = "skipped"
            found.skipped[commit.sha] = str(error)
            notify(f"skip {commit}: {error}")
            continue
        states[place] = "bad" if why else "good"
        _report(notify, "bad " if why else "good", commit, why)
    last_good, first_bad = _ends(states)
    found.first = list(candidates[last_good + 1 : first_bad + 1])
    return found


def _ends(states: dict[int, State]) -> tuple[int, int]:
    """Returns the first bad index and the last good one before it, as (good, bad)."""
    bad = min(place for place, state in states.items() if state == "bad")
    return max(p for p, state in states.items() if state == "good" and p < bad), bad


def _next(states: dict[int, State], count: int) -> int | None:
    """Returns the untested index closest to the middle between the two ends."""
    good, bad = _ends(states)
    middle = (good + bad) / 2
    unknown = [place for place in range(good + 1, min(bad, count)) if place not in states]
    return min(unknown, key=lambda place: (abs(place - middle), place), default=None)


def _end(commit: Commit, measures: Measures, name: str) -> Results:
    try:
        return measures.measure(commit)
    except SkippedError as error:
        raise SlambedError(
            f"the {name} commit {commit.short} cannot be measured: {error}; name another one"
        ) from None


def _report(notify: Notify, state: str, commit: Commit, why: list[str]) -> None:
    more = f" and {len(why) - 1} more" if len(why) > 1 else ""
    notify(f"{state} {commit}" + (f": {why[0]}{more}" if why else ""))


def _measured(runs: pd.DataFrame, key: str) -> bool:
    return key in runs and bool(runs[key].notna().any())
