# SPDX-License-Identifier: Apache-2.0
"""`slambed bisect`: between a good and a bad commit, the first one that the regression gate would
not pass."""

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
    """One of the repository."""

    sha: str
    subject: str

    @property
    def short(self) -> str:
        """As people call it, and its folder."""
        return self.sha[:12]

    def __str__(self) -> str:
        return f"{self.short} {self.subject}"


class SkippedError(Exception):
    """A commit that cannot be measured: it does not build, or its harness does not run it."""


class Measures(Protocol):
    """Where the runs of commits come from."""

    def measure(self, commit: Commit) -> Results:
        """Its runs, made now where they are not there. Raises SkippedError."""


@dataclass
class Bisected:
    """The answer; none of `first` where nothing got worse."""

    first: list[Commit] = field(default_factory=list)
    """The first bad commit; more than one where skipped ones stand before it."""
    why: list[str] = field(default_factory=list)
    """What got worse between the good and the bad end."""
    skipped: dict[str, str] = field(default_factory=dict)
    """Commit -> why it could not be measured."""
    tried: int = 0


@dataclass
class RegressionRule:
    """The regression gate's rule, for commits in the place of nights: runs of equal seed are pairs,
    a change counts where it is significant and relevant."""

    good: Results
    metrics: list[str]
    """Only these; none: all that the regression gate looks at."""
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
        """Why this one would not pass; empty where it would."""
        return judge(self.good.runs, commit.runs, self.alpha, self.metrics).failures


def bisect(
    good: Commit,
    candidates: Sequence[Commit],
    measures: Measures,
    metrics: list[str],
    alpha: float = ALPHA,
    notify: Notify = lambda line: None,
) -> Bisected:
    """Finds the first bad one of `candidates`: the commits after `good` in their order, the last of
    which is the bad end.

    Raises SlambedError where one of the ends cannot be measured."""
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
    """The last good one and the first bad one after it."""
    bad = min(place for place, state in states.items() if state == "bad")
    return max(p for p, state in states.items() if state == "good" and p < bad), bad


def _next(states: dict[int, State], count: int) -> int | None:
    """The one in the middle of those that nothing is known of yet, between the two ends."""
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
