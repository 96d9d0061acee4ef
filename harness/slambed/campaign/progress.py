# SPDX-License-Identifier: Apache-2.0
"""Reports the progress of a campaign: a bar with ETA on a terminal, plain lines elsewhere."""

import time
from types import TracebackType
from typing import Protocol, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn

from slambed.campaign.overall import Overall
from slambed.process.standard_streams import without_terminal
from slambed.spec.run_spec import RunSpec


class Reporter(Protocol):
    """Callbacks of a campaign."""

    def run_started(self, spec: RunSpec) -> None: ...
    def run_ended(self, spec: RunSpec, verdict: str) -> None: ...
    def run_failed(self, spec: RunSpec, why: str, last: bool) -> None: ...


def duration(seconds: float) -> str:
    """Formats like `1 h 05 min`, `3 min 20 s`, `12 s`."""
    whole = round(seconds)
    if whole >= 3600:
        return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
    if whole >= 60:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole} s"


class CampaignProgress:
    """Shows runs as they finish. The ETA uses the mean duration of finished runs; before the
    first one, the expected duration. With `overall`, counts and ETA are those of all experiments
    of the campaign."""

    def __init__(
        self,
        console: Console,
        total: int,
        expected_run_s: float,
        jobs: int = 1,
        overall: Overall | None = None,
    ) -> None:
        self._jobs = jobs
        self._overall = overall
        self._console = console
        self._total = total
        self._expected_s = expected_run_s
        self._done = 0
        self._spent_s = 0.0
        self._began_s: dict[str, float] = {}
        self._bar: Progress | None = None
        self._task: TaskID | None = None

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[left]}"),
                console=self._console,
            )
            self._bar.start()
            done, total = self._counts()
            self._task = self._bar.add_task("", total=total, completed=done, left="")
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            with without_terminal():
                self._bar.stop()

    def left_s(self) -> float:
        """Returns the expected remaining time."""
        if self._overall is not None:
            return self._overall.left_s()
        each = self._spent_s / self._done if self._done else self._expected_s
        return each * (self._total - self._done) / self._jobs

    def run_started(self, spec: RunSpec) -> None:
        """A run has started."""
        self._began_s[spec.run_key] = time.monotonic()
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, description=_name(spec), left=self._left())

    def run_ended(self, spec: RunSpec, verdict: str) -> None:
        """A run was committed."""
        took_s = time.monotonic() - self._began_s.pop(spec.run_key)
        self._spent_s += took_s
        self._done += 1
        if self._overall is not None:
            self._overall.ended(spec.experiment, took_s)
        self._print(spec, verdict, took_s)

    def run_failed(self, spec: RunSpec, why: str, last: bool) -> None:
        """An attempt ended without a result; `last`: there will be no other attempt."""
        took_s = time.monotonic() - self._began_s.pop(spec.run_key)
        if last:
            self._total -= 1
            if self._overall is not None:
                self._overall.given_up(spec.experiment)
        self._print(spec, f"no result: {why}" if last else why, took_s)

    def _counts(self) -> tuple[int, int]:
        if self._overall is not None:
            return self._overall.done, self._overall.total
        return self._done, self._total

    def _left(self) -> str:
        line = f"{duration(self.left_s())} left"
        decided = self._overall.decided if self._overall is not None else ""
        return f"{line}; {decided}" if decided else line

    def _print(self, spec: RunSpec, verdict: str, took_s: float) -> None:
        done, total = self._counts()
        line = f"[{done:>{len(str(total))}}/{total}] {_name(spec)}: {verdict}"
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=done, total=total, left=self._left())
        else:
            line += f" ({duration(took_s)}; {self._left()})"
        with without_terminal():
            self._console.print(line, highlight=False, markup=False, soft_wrap=True)


def _name(spec: RunSpec) -> str:
    return spec.run_name
