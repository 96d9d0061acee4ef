# SPDX-License-Identifier: Apache-2.0
"""The account of a campaign over several experiments: runs done, time left, and a time budget."""

import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from slambed.errors import SlambedError

UNITS_S = {"h": 3600.0, "min": 60.0, "m": 60.0, "s": 1.0}
_PART = re.compile(r"(\d+(?:\.\d+)?)(h|min|m|s)")


def budget_s(text: str) -> float:
    """Returns the seconds of `2h`, `90min` or `1h30min`. Raises SlambedError for anything else."""
    parts = _PART.findall(text)
    seconds = sum(float(number) * UNITS_S[unit] for number, unit in parts)
    if not parts or "".join(n + u for n, u in parts) != text or seconds <= 0:
        raise SlambedError(f"--budget {text} is no time above 0; write 2h, 90min or 1h30min")
    return seconds


@dataclass(frozen=True)
class Outlook:
    """What is left of one experiment before it is played."""

    runs: int
    """Runs of its plan."""
    missing: int
    """Those that are not there. All of them where a sequence has to be made first, because run
    keys contain its checksum."""
    run_s: float
    """Expected duration of one run in seconds."""
    is_counted: bool = True
    """False where a sequence has to be made first."""


@dataclass
class Overall:
    """Counts over all experiments of a campaign. The time left uses expected durations, corrected
    by how long the runs of this campaign took compared with what was expected of them."""

    outlooks: dict[str, Outlook]
    jobs: int
    budget_s: float | None = None
    decided: str = ""
    """What the runs decide so far, for the progress line."""
    clock: Callable[[], float] = time.monotonic
    done: int = 0
    """Runs that are there."""
    _left: dict[str, int] = field(default_factory=dict)
    _spent_s: float = 0.0
    _expected_s: float = 0.0
    _began_s: float = 0.0

    def __post_init__(self) -> None:
        self._left = {name: item.missing for name, item in self.outlooks.items()}
        self.done = sum(item.runs - item.missing for item in self.outlooks.values())
        self._began_s = self.clock()

    @property
    def total(self) -> int:
        return self.done + self.left

    @property
    def left(self) -> int:
        """Returns the number of runs that are not there."""
        return sum(self._left.values())

    @property
    def is_used_up(self) -> bool:
        """Returns whether no further run may be started."""
        return self.budget_s is not None and self.clock() - self._began_s >= self.budget_s

    def begin(self, name: str, there: int, missing: int, jobs: int) -> None:
        """Replaces the outlook of an experiment by what its campaign found. `jobs`: concurrent runs
        of its executor."""
        if missing:
            self.jobs = jobs
        known = self.outlooks.get(name)
        before = known.runs - self._left[name] if known is not None else 0
        self.done += there - before
        self._left[name] = missing
        run_s = known.run_s if known is not None else math.nan
        self.outlooks[name] = Outlook(there + missing, missing, run_s)

    def ended(self, name: str, took_s: float) -> None:
        """Counts a run that is there now."""
        self.done += 1
        self._left[name] -= 1
        expected_s = self.outlooks[name].run_s
        if expected_s == expected_s:
            self._spent_s += took_s
            self._expected_s += expected_s

    def given_up(self, name: str) -> None:
        """Counts a run that will have no result."""
        self._left[name] -= 1

    def left_s(self) -> float:
        """Returns the expected remaining time in seconds."""
        factor = self._spent_s / self._expected_s if self._expected_s > 0 else 1.0
        known = [(self._left[name], item.run_s) for name, item in self.outlooks.items()]
        return factor * sum(n * s for n, s in known if s == s) / self.jobs
