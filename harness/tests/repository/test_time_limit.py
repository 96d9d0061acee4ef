# SPDX-License-Identifier: Apache-2.0
"""A hanging test is ended within the limit and named, and the other tests continue."""

import fcntl
import os
import re
import subprocess
import sys
import threading
import time
from collections import Counter
from pathlib import Path

import pytest
from conftest import PLACE, QUIET
from waiting import in_background, until

HANGING = """
import signal, threading, time
from contextlib import suppress
import pytest

pytestmark = pytest.mark.timeout(1)

def hang():
    threading.Event().wait()

@pytest.fixture
def hangs():
    hang()

@pytest.fixture(scope="module")
def hangs_at_the_end():
    yield
    hang()

def test_waits():
    hang()

def test_joins():
    thread = threading.Thread(target=hang)
    thread.start()
    thread.join()

def test_has_a_fixture_that_hangs(hangs):
    pass

def test_hangs_while_it_fails():
    try:
        hang()
    finally:
        hang()

def test_catches_everything():
    with suppress(BaseException):
        hang()

@pytest.mark.timeout(300)
def test_goes_on():
    pass

def test_fails_and_its_fixture_hangs(hangs_at_the_end):
    raise ValueError
"""
DEAF = """
import signal, threading
import pytest

@pytest.mark.timeout(1)
def test_hears_no_alarm():
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGALRM])
    threading.Event().wait()

def test_goes_on():
    pass
"""
FINE = "def test_is_fine():\n    pass\n"
LIVE = """
import time
import pytest

@pytest.mark.live
@pytest.mark.timeout(1)
def test_waits_for_its_turn():
    pass
"""
# The options of tools/test.sh.
BY_FILE = ("-n", "2", "--dist", "loadfile", "--no-loadscope-reorder")
ENDS_S = 240.0
"""A session that takes this long is considered hanging."""


def session(
    folder: Path, *options: str, place: Path | None = None, **constants: float
) -> tuple[int, str]:
    """Returns exit code and output of pytest with our conftest on the tests of a folder, with
    changed constants of time_limit.py."""
    environment = {key: value for key, value in os.environ.items() if key != PLACE}
    environment["PYTHONPATH"] = str(Path(__file__).parents[1])
    if place is not None:
        environment[PLACE] = str(place)
    (folder / "pytest.ini").write_text("[pytest]\nmarkers =\n  live: of this test\n")
    setting = [f"time_limit.{name} = {value}\n" for name, value in constants.items()]
    (folder / "conftest.py").write_text("import time_limit\n" + "".join(setting))
    command = [sys.executable, "-m", "pytest", "-p", "conftest", "-p", "no:cacheprovider", "-rA"]
    done = subprocess.run(
        [*command, f"--basetemp={folder / 'temporary'}", "--color=no", *options, str(folder)],
        env=environment | {"COLUMNS": "300"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=ENDS_S,
        check=False,
    )
    return done.returncode, done.stdout


def results(out: str) -> Counter[tuple[str, str]]:
    """Returns (FAILED, ERROR or PASSED, test) of the summary lines of a session."""
    return Counter(re.findall(r"^(FAILED|ERROR|PASSED) \S+::(\w+)", out, re.M))


def test_what_hangs_is_ended_and_named_and_the_others_go_on(tmp_path: Path) -> None:
    (tmp_path / "test_hanging.py").write_text(HANGING)
    (tmp_path / "test_fine.py").write_text(FINE)
    code, out = session(tmp_path, *BY_FILE, AGAIN_S=0.3)
    assert code == pytest.ExitCode.TESTS_FAILED, out
    assert results(out) == {
        ("FAILED", "test_waits"): 1,
        ("FAILED", "test_joins"): 1,
        ("ERROR", "test_has_a_fixture_that_hangs"): 1,
        ("FAILED", "test_hangs_while_it_fails"): 1,
        ("FAILED", "test_catches_everything"): 1,
        ("PASSED", "test_goes_on"): 1,
        ("FAILED", "test_fails_and_its_fixture_hangs"): 1,
        ("ERROR", "test_fails_and_its_fixture_hangs"): 1,
        ("PASSED", "test_is_fine"): 1,
    }, out
    # One line has the test, its limit, and where it hung.
    line = r"^FAILED \S+test_joins - Failed: the limit of 1 s is over: \S+::test_joins is not done"
    assert re.search(line, out, re.M), out
    assert re.search(r'^  File "\S+test_hanging.py", line \d+ in hang$', out, re.M), out


def test_what_no_alarm_ends_costs_its_process_and_no_other_test(tmp_path: Path) -> None:
    # The first worker has finished the first file when it dies in the third.
    for name in ("test_a.py", "test_b.py"):
        (tmp_path / name).write_text(FINE)
    (tmp_path / "test_c.py").write_text(DEAF)
    code, out = session(tmp_path, *BY_FILE, AGAIN_S=0.3, LAST_S=1.0)
    assert code == pytest.ExitCode.TESTS_FAILED, out
    assert results(out) == {
        ("PASSED", "test_is_fine"): 2,
        ("FAILED", "test_hears_no_alarm"): 1,
        ("ERROR", "test_hears_no_alarm"): 1,  # the next worker refused it
        ("PASSED", "test_goes_on"): 1,
    }, out
    assert re.search(r'^  File "\S+test_c.py", line \d+ in test_hears_no_alarm$', out, re.M), out


def test_a_live_test_may_wait_for_its_turn(tmp_path: Path) -> None:
    """The wait may exceed its limit, which covers only its own work."""
    place = tmp_path / "place"
    place.mkdir()
    (tmp_path / "test_live.py").write_text(LIVE)
    with (place / QUIET).open("w") as file:
        fcntl.flock(file, fcntl.LOCK_SH)

        def let_go() -> None:
            until(lambda: _waits_for(place / QUIET), "a test that waits", ENDS_S)
            time.sleep(2.0)
            fcntl.flock(file, fcntl.LOCK_UN)

        with in_background(let_go):
            code, out = session(tmp_path, place=place)
    assert code == pytest.ExitCode.OK, out
    assert results(out) == {("PASSED", "test_waits_for_its_turn"): 1}, out


def _waits_for(path: Path) -> bool:
    """Returns whether a process waits for a lock of this file (proc_locks(5))."""
    inode = f":{path.stat().st_ino} "
    return any(" -> " in line and inode in line for line in Path("/proc/locks").open())


def test_a_thread_that_nobody_ends_does_not_keep_the_session(tmp_path: Path) -> None:
    text = "import threading\n\ndef test_leaves_a_thread():\n"
    text += "    threading.Thread(target=threading.Event().wait).start()\n"
    (tmp_path / "test_thread.py").write_text(text)
    code, out = session(tmp_path, EXIT_S=1.0)
    assert ("PASSED", "test_leaves_a_thread") in results(out)
    assert code != pytest.ExitCode.OK and "in _shutdown" in out, out


def test_every_test_has_a_limit(request: pytest.FixtureRequest) -> None:
    assert float(request.config.getini("timeout")) == 300
    assert threading.main_thread() is threading.current_thread(), "no alarm reaches it"
