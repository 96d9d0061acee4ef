# SPDX-License-Identifier: Apache-2.0
"""No test exceeds its time limit: `timeout` in pyproject.toml, or the mark of that name.

pytest-timeout reads the limits and reports begin and end of tests. The alarm is implemented here:
its own alarm fires only once and is canceled as soon as a test has failed. A `finally`, the
teardown of a fixture, or an `except BaseException` could then hang forever. This alarm fires
repeatedly until the test is done, and finally ends the process.
"""

import faulthandler
import os
import signal
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import pytest
import pytest_timeout

AGAIN_S = 60.0
"""Time between repetitions of the alarm."""
LAST_S = 300.0
"""Time after the limit at which a process ends that does not react to the alarm, such as C code
that does not return."""
EXIT_S = 60.0
"""Time for a process to exit after all tests; a thread may prevent that."""


@dataclass
class Limit:
    """The time limit of one test."""

    item: pytest.Item
    seconds: float
    began_s: float = field(default_factory=time.monotonic)
    works: bool = False
    """Whether the test or one of its fixtures is running."""
    struck: str = ""
    """Message of the alarm, until a report shows it."""

    def start(self, stderr: int) -> None:
        """Sets the alarm, which may have been canceled meanwhile."""
        left_s = self.seconds - (time.monotonic() - self.began_s)
        signal.setitimer(signal.ITIMER_REAL, left_s if left_s > 0 else AGAIN_S, AGAIN_S)
        last_s = max(left_s + LAST_S, AGAIN_S)
        faulthandler.dump_traceback_later(last_s, exit=True, file=stderr)

    def strike(self) -> None:
        """Fails the running test; does nothing while pytest itself is running."""
        __tracebackhide__ = True
        if not self.works or pytest_timeout.is_debugging():
            return
        passed_s = time.monotonic() - self.began_s
        self.struck = (
            f"the limit of {self.seconds:g} s is over: {self.item.nodeid} is not done "
            f"after {passed_s:.0f} s"
        )
        self.item.add_report_section("at the limit", "stacks", _stacks())
        pytest.fail(self.struck)


def _stacks() -> str:
    """Returns the stacks of all threads."""
    with tempfile.TemporaryFile("w+") as file:
        faulthandler.dump_traceback(file)
        file.seek(0)
        return file.read()


class TimeLimit:
    """The plugin."""

    def __init__(self) -> None:
        # pytest captures the other stderr of the tests.
        self._stderr = os.dup(2)
        self._limit: Limit | None = None

    def pytest_timeout_set_timer(
        self, item: pytest.Item, settings: pytest_timeout.Settings
    ) -> bool:
        self._limit = limit = Limit(item, settings.timeout)
        signal.signal(signal.SIGALRM, lambda *_: limit.strike())
        limit.start(self._stderr)
        return True

    def pytest_timeout_cancel_timer(self, item: pytest.Item) -> bool:
        signal.setitimer(signal.ITIMER_REAL, 0)
        faulthandler.cancel_dump_traceback_later()
        return True

    @pytest.hookimpl(trylast=True)
    def pytest_exception_interact(self, node: pytest.Item) -> None:
        """Here pytest and pytest-timeout cancel alarms for debuggers; but the teardown after a
        failure may also hang."""
        if self._limit is not None and self._limit.item is node:
            self._limit.start(self._stderr)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self) -> Iterator[None]:
        with self._at_work():
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Iterator[None]:
        with self._at_work():
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_teardown(self) -> Iterator[None]:
        with self._at_work():
            return (yield)

    @contextmanager
    def _at_work(self) -> Iterator[None]:
        if self._limit is None:  # --timeout=0
            yield
            return
        self._limit.works = True
        try:
            yield
        finally:
            self._limit.works = False

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Iterator[None]:
        """A test that caught the alarm's exception fails anyway."""
        report = yield
        if self._limit is not None and self._limit.struck:
            if report.outcome != "failed":
                report.outcome, report.longrepr = "failed", self._limit.struck
            self._limit.struck = ""
        return report

    def pytest_unconfigure(self, config: pytest.Config) -> None:
        if hasattr(config, "workerinput"):
            return  # workers wait for each other and are ended by the main process
        faulthandler.dump_traceback_later(EXIT_S, exit=True, file=self._stderr)
