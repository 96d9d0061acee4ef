# SPDX-License-Identifier: Apache-2.0
"""Repeats a live test, at most twice, if it fails while the host is measurably late; reports that.

A separate process (`host_watcher`) with the tests' priority measures how late this host is. Its
measurements during the test and during the setup of its wider fixtures count, such as a module's
campaign. These fixtures are set up again before a repetition; pytest-rerunfailures would keep them
and test the same disturbed campaign again. On a host in time a failure counts at once, and so does
a test that exceeded its time limit, which no stall explains.

conftest.py registers the plugin. docs/how-to/test-a-change.md describes how else a host can disturb
tests.
"""

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import pytest
import pytest_timeout
from _pytest.runner import runtestprotocol

MOST_REPEATS = 2
NAP_MS = 100.0
"""With three compilers and two busy loops no sleep was late by more than 35 ms. When processes of a
higher class used the CPUs for 40 % of the time, so that nodes nearly always waited, it was 264 ms.
"""
STEAL_SHARE = 0.05
"""Ten times the maximum observed during a valid run."""
PRESSURE_SHARE, PRESSURE_S = 0.95, 10.0
"""Pressure that counts as late, over at least this time. It includes processes that yield to
live tests: with load on all CPUs it reached 91 % in tests of such length without failures, and
100 % in shorter ones. When tests really starved it was 96 % for minutes."""
PATIENCE_S = 10.0
"""Timeout for the watcher, which normally answers in a millisecond: a host that exceeds it is
late."""
REPEATED = "repeated because the host was late"
"""Name of the property in reports, including those of pytest-xdist's workers."""
NOT_BESIDE = ("usepdb", "setuponly", "setupshow")
"""Options that disable repetitions."""


@dataclass(frozen=True)
class Lateness:
    """Maximum lateness of the host in some time; zero without a watcher."""

    nap_ms: float = 0.0
    """Maximum oversleep of a 10 ms sleep."""
    steal: float = 0.0
    """Maximum share of all CPUs in one second that the hypervisor gave to other guests."""
    pressure: float | None = None
    """Share of the time in which some process waited for a CPU."""
    seconds: float = 0.0
    """The total time."""

    @property
    def is_late(self) -> bool:
        """Whether this may have disturbed a live test."""
        pressed = self.pressure is not None and self.pressure >= PRESSURE_SHARE
        starved = pressed and self.seconds >= PRESSURE_S
        return self.nap_ms >= NAP_MS or self.steal >= STEAL_SHARE or starved

    def __str__(self) -> str:
        pressure = "unknown" if self.pressure is None else f"{self.pressure:.0%}"
        return f"largest nap {self.nap_ms:.0f} ms, steal {self.steal:.1%}, pressure {pressure}"


@dataclass(frozen=True)
class Look:
    """The watcher's measurements of about one second."""

    began_s: float
    ended_s: float
    nap_ms: float
    stolen_s: float
    waited_s: float | None


@dataclass(frozen=True)
class Window:
    """An interval of the monotonic clock."""

    began_s: float
    ended_s: float


class Watch:
    """The watcher and its measurements. If it is killed, the host does not count as late."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[bytes] | None = None
        self.looks: list[Look] = []

    def start(self) -> None:
        """Starts the watcher if needed, with the caller's priority."""
        if self.process is None or self.process.poll() is not None:
            program = Path(__file__).with_name("host_watcher.py")
            self.process = subprocess.Popen(
                [sys.executable, "-IS", program],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env={},
            )
        self.ask()

    def ask(self) -> None:
        """Fetches all measurements so far."""
        if self.process is None:
            return
        question, answer = self.process.stdin, self.process.stdout
        assert question is not None and answer is not None
        asked_s, line = time.monotonic(), b""
        try:
            question.write(b"\n")
            question.flush()
            line = _line(answer, asked_s + PATIENCE_S)
        except BrokenPipeError:
            pass
        except TimeoutError:
            self.looks.append(Look(asked_s, time.monotonic(), 1e3 * PATIENCE_S, 0.0, None))
        finally:
            # An incomplete answer may be left if a test's time limit expires here.
            if not line:
                self.close()
        self.looks += [Look(**look) for look in json.loads(line or "[]")]

    def lateness(self, windows: Iterable[Window]) -> Lateness:
        """Returns the lateness over these intervals, as far as fetched."""
        found = {
            look: None
            for window in windows
            for look in self.looks
            if look.began_s < window.ended_s and look.ended_s > window.began_s
        }
        seconds = sum(look.ended_s - look.began_s for look in found)
        waited = [look.waited_s for look in found if look.waited_s is not None]
        return Lateness(
            nap_ms=max((look.nap_ms for look in found), default=0.0),
            # Part of a second has too few kernel ticks for its own share.
            steal=max((look.stolen_s for look in found), default=0.0),
            pressure=sum(waited) / seconds if waited else None,
            seconds=seconds,
        )

    def close(self) -> None:
        """Ends the watcher."""
        if self.process is not None:
            self.process.kill()
            self.process.communicate()
            self.process = None


def _line(answer: IO[bytes], deadline: float) -> bytes:
    """Returns the next line; empty at the end of the output."""
    line = b""
    while not line.endswith(b"\n"):
        ready, _, _ = select.select([answer], [], [], max(0.0, deadline - time.monotonic()))
        if not ready:
            raise TimeoutError
        part = os.read(answer.fileno(), 65536)
        if not part:
            return b""
        line += part
    return line


@dataclass
class Attempt:
    """One attempt at a live test."""

    item: pytest.Item
    last: bool
    """There will be no further attempt."""
    limit: pytest_timeout.Settings
    began_s: float = field(default_factory=time.monotonic)
    failed: list[pytest.TestReport] = field(default_factory=list)
    judged: bool = False
    """Whether lateness was checked; a late sleep after the failure explains nothing."""
    excused: Lateness | None = None
    """Lateness of the host if the failure is discarded because of it."""

    def is_over_its_limit(self) -> bool:
        """A stall of the host does not explain that."""
        return 0 < (self.limit.timeout or 0) <= time.monotonic() - self.began_s

    def start_its_limit(self) -> None:
        """Restarts the time limit for a further attempt."""
        if self.limit.timeout and not self.limit.func_only:
            hook = self.item.config.hook
            hook.pytest_timeout_cancel_timer(item=self.item)
            hook.pytest_timeout_set_timer(item=self.item, settings=self.limit)


@dataclass(eq=False)
class HostLate:
    """The plugin."""

    watch: Watch = field(default_factory=Watch)
    live: int = 0
    """Number of reported tests."""
    repeated: list[dict[str, Any]] = field(default_factory=list)
    """Discarded failures, as shown in reports."""
    _wide: dict[pytest.FixtureDef[Any], Window] = field(default_factory=dict)
    """Last setup times of fixtures wider than one test."""
    _attempt: Attempt | None = None

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(
        self, fixturedef: pytest.FixtureDef[Any]
    ) -> Generator[None, object, object]:
        began_s = time.monotonic()
        try:
            return (yield)
        finally:
            if fixturedef.scope != "function":
                self._wide[fixturedef] = Window(began_s, time.monotonic())

    @pytest.hookimpl
    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> object:
        if item.get_closest_marker("live") is None or any(map(item.config.getoption, NOT_BESIDE)):
            return None
        item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        for report in self._reports(item, nextitem):
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        return True

    def _reports(self, item: pytest.Item, nextitem: pytest.Item | None) -> list[pytest.TestReport]:
        """Returns the reports of the attempt that counts."""
        limit = pytest_timeout._get_item_settings(item)
        for number in range(1 + MOST_REPEATS):
            self.watch.start()
            self._attempt = attempt = Attempt(item, number == MOST_REPEATS, limit)
            if number:
                attempt.start_its_limit()
            reports = runtestprotocol(item, log=False, nextitem=nextitem)
            lateness = self._excuse(attempt)
            self._attempt = None
            if lateness is None:
                break
            reported = {
                "test": item.nodeid,
                "why": _reason(attempt.failed[0]),
                "late": vars(lateness),
            }
            item.user_properties.append((REPEATED, reported))
            item._report_sections.clear()
            for name in ("_instance", "_obj"):
                item.__dict__.pop(name, None)
        return reports

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        report = yield
        if self._attempt is not None and report.failed:
            self._attempt.failed.append(report)
        return report

    @pytest.hookimpl(trylast=True)
    def pytest_runtest_teardown(self, item: pytest.Item) -> None:
        """Runs after fixtures are torn down, within the time limit of the test."""
        if self._attempt is not None and self._excuse(self._attempt) is not None:
            item.session._setupstate.teardown_exact(None)

    def _excuse(self, attempt: Attempt) -> Lateness | None:
        """Returns the host's lateness if the failure of this attempt is to be discarded."""
        if attempt.failed and not attempt.last and not attempt.judged:
            attempt.judged, lateness = True, self.lateness()
            if lateness.is_late and not attempt.is_over_its_limit():
                attempt.excused = lateness
        return attempt.excused

    def lateness(self) -> Lateness:
        """Returns the lateness of the host during the current live test."""
        if self._attempt is None:
            return Lateness()
        self.watch.ask()
        info = getattr(self._attempt.item, "_fixtureinfo", None)
        used = [d for found in info.name2fixturedefs.values() for d in found] if info else []
        own = Window(self._attempt.began_s, time.monotonic())
        return self.watch.lateness([own, *(self._wide[d] for d in used if d in self._wide)])

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "setup" and "live" in report.keywords:
            self.live += 1
            self.repeated += [
                expected for name, expected in report.user_properties if name == REPEATED
            ]

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if not self.live:
            return
        found = [Lateness(**expected["late"]) for expected in self.repeated]
        names = sorted({expected["test"].rpartition("/")[2] for expected in self.repeated})
        more = f" ({', '.join(names)}; at most {_worst(found)})" if found else ""
        terminalreporter.write_line(
            f"repeated: {len(names)} live tests because the host was late{more}"
        )
        for expected, late in zip(self.repeated, found, strict=True):
            terminalreporter.write_line(
                f"repeated: {expected['test']} after {expected['why']} ({late})"
            )

    def pytest_unconfigure(self) -> None:
        self.watch.close()


HOST = HostLate()
"""The plugin instance of this process."""


def is_late() -> bool:
    """Returns whether the host has been late during the current live test."""
    return HOST.lateness().is_late


def _worst(found: list[Lateness]) -> Lateness:
    pressures = [late.pressure for late in found if late.pressure is not None]
    return Lateness(
        nap_ms=max(late.nap_ms for late in found),
        steal=max(late.steal for late in found),
        pressure=max(pressures, default=None),
    )


def _reason(report: pytest.TestReport) -> str:
    """Returns the reason of a failure in one line."""
    crash = getattr(report.longrepr, "reprcrash", None)
    lines = str(crash.message if crash else report.longrepr).split("\n")
    return lines[0 if crash else -1]
