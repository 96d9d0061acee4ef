# SPDX-License-Identifier: Apache-2.0
"""Isolates all tests from this machine, so that its files change no result.

Home and cache are empty private folders, like a new user's home, and recordings next to the
checkout are ignored. Tests that need recordings or a browser are marked and run only with
`--recordings` or `--browser`. docs/how-to/test-a-change.md describes the kinds of tests.
"""

import contextlib
import fcntl
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from browser import Page, browser
from dead_worker import DeadWorker
from host_late import HOST
from skip_rules import unexpected
from time_limit import TimeLimit

from slambed.native import repository_root

PLACE = "SLAMBED_TEST_PLACE"
"""Set for the processes of one session: pytest-xdist's workers and child processes of tests."""
STANDING = "SLAMBED_STANDING"
"""Folder in which each process writes its current test, so that tools/test.sh can report where a
hanging session stopped."""
QUIET = "quiet.lock"
"""Exclusive lock of a live test, shared lock of all others: nothing else computes during a live
test."""
GIVEN = {"recordings": "FOLDER", "browser": "PROGRAM"}
"""Marks of tests that need the option of the same name."""
ROOT_NEEDED, PROGRAMS_NEEDED = ("needs root", "needs Docker", "TUN", "netem"), "make build"

# A test may use the helper modules of other test folders, even if only some tests are selected.
sys.path += [str(room) for room in sorted(Path(__file__).parent.iterdir()) if room.is_dir()]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--recordings", default="", help="Folders of recordings, a colon list.")
    parser.addoption("--browser", default="", help="Chromium, for the tests that open pages in it.")
    parser.addoption("--nightly", action="store_true", help="With the tests marked nightly.")
    parser.addoption(
        "--strict-skips", action="store_true", help="Fail for a skip that this host explains not."
    )


def pytest_configure(config: pytest.Config) -> None:
    if repository_root() != Path(__file__).resolve().parents[2]:
        # In a copied tree the tests would import the other checkout.
        pytest.exit(f"slambed is that of {repository_root()}; run 'make setup-dev' here", 3)
    if PLACE not in os.environ:
        _settle(config)
    config.pluginmanager.register(TimeLimit())
    config.pluginmanager.register(HOST)
    config.pluginmanager.register(DeadWorker(Path(os.environ[PLACE])))


def _settle(config: pytest.Config) -> None:
    place = Path(tempfile.mkdtemp(prefix="slambed-tests-"))
    config.add_cleanup(lambda: _leave(place))
    home = place / "home"
    home.mkdir(mode=0o700)
    os.environ[PLACE] = str(place)
    os.environ["HOME"] = str(home)
    # Matplotlib then searches fonts once per session instead of once per process.
    os.environ["MPLCONFIGDIR"] = str(place / "matplotlib")
    os.environ["SLAMBED_DATA_BESIDE"] = "no"
    for name in ("SLAMBED_CACHE", "SLAMBED_DATA", "XDG_CACHE_HOME"):
        os.environ.pop(name, None)


def _leave(place: Path) -> None:
    os.environ.pop(PLACE, None)
    shutil.rmtree(place, ignore_errors=True)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Marks live tests and those of programs by their skip reasons, puts live ones last, and
    deselects tests whose option is missing."""
    for item in items:
        reasons = [str(mark.kwargs.get("reason")) for mark in item.iter_markers("skipif")]
        if any(part in reason for reason in reasons for part in ROOT_NEEDED):
            item.add_marker("live")
        if any(PROGRAMS_NEEDED in reason for reason in reasons):
            item.add_marker("programs")
    items.sort(key=lambda item: item.get_closest_marker("live") is not None)
    missing = [name for name in (*GIVEN, "nightly") if not config.getoption(f"--{name}")]
    without = [item for item in items if any(map(item.get_closest_marker, missing))]
    if without:
        config.hook.pytest_deselected(items=without)
        items[:] = [item for item in items if item not in without]


# tryfirst, so that the time limit of a test excludes its wait for the lock.
@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    live = item.get_closest_marker("live") is not None
    with _standing(item.nodeid), (Path(os.environ[PLACE]) / QUIET).open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX if live else fcntl.LOCK_SH)
        with _before_others() if live else contextlib.nullcontext():
            return (yield)


@contextlib.contextmanager
def _standing(test: str) -> Iterator[None]:
    folder = os.environ.get(STANDING)
    if folder is None:
        yield
        return
    file = Path(folder) / str(os.getpid())
    file.write_text(f"{test}\n")
    yield
    file.unlink()


@contextlib.contextmanager
def _before_others() -> Iterator[None]:
    """Gives this process and its children priority over other work on this host, such as a
    compiler; has no effect without permission. Nodes have priority anyway through their cgroups."""
    before = os.getpriority(os.PRIO_PROCESS, 0)
    _give_priority(-20)
    try:
        yield
    finally:
        _give_priority(before)


def _give_priority(nice: int) -> None:
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, nice)
        # Kernels with autogroups divide CPU time among sessions first.
        Path("/proc/self/autogroup").write_text(str(nice))


def _skips(config: pytest.Config) -> dict[str, int]:
    """Returns skip reason -> number of tests, in the reporting process."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    found: dict[str, int] = {}
    for report in reporter.stats.get("skipped", []) if reporter else []:
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        reason = reason.removeprefix("Skipped: ")
        found[reason] = found.get(reason, 0) + 1
    return found


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    config = session.config
    if not config.getoption("--strict-skips") or hasattr(config, "workerinput"):
        return
    if exitstatus == pytest.ExitCode.OK and any(map(unexpected, _skips(config))):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    config = terminalreporter.config
    for reason, count in sorted(_skips(config).items()):
        why = "UNEXPECTED here" if unexpected(reason) else "expected here"
        terminalreporter.write_line(f"skipped: {count} ({why}): {reason}")
    left_out = terminalreporter.stats.get("deselected", [])
    options = {name: f"no {name}, give --{name}={what}" for name, what in GIVEN.items()}
    options["nightly"] = "for the nightly, give --nightly"
    for name, why in options.items():
        count = sum(1 for item in left_out if item.get_closest_marker(name))
        if count and not config.getoption(f"--{name}"):
            terminalreporter.write_line(f"left out: {count}: {why}")


@pytest.fixture
def recording(request: pytest.FixtureRequest) -> Callable[[str], Path]:
    """Finds a file or folder of the recordings by name."""

    def find(name: str) -> Path:
        folders = [Path(f) for f in request.config.getoption("--recordings").split(":") if f]
        for folder in folders:
            if (found := folder / name).exists():
                return found
        pytest.skip(f"no recording {name} in the folders given")

    return find


@pytest.fixture(scope="module")
def chromium(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Page]:
    profile = tmp_path_factory.mktemp("profile")
    with browser(request.config.getoption("--browser"), profile) as page:
        yield page


@pytest.fixture
def page(chromium: Page) -> Iterator[Page]:
    chromium.size(1200)
    chromium.prefers("light")
    chromium.scripts(True)
    chromium.problems.clear()
    yield chromium
    assert chromium.problems == []
