# SPDX-License-Identifier: Apache-2.0
"""A live test that fails while the host is late is repeated and reported; other tests are not."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import harness_parts
import host_late
import pytest
from harness_parts import is_valid_run
from host_late import NAP_MS, PRESSURE_S, PRESSURE_SHARE, STEAL_SHARE, Lateness, Look, Watch, Window

STALL_S = 0.6
STALLED = f"""
import os, signal, subprocess, sys, time
from pathlib import Path
import pytest

HERE = Path(__file__).parent
STALL = '''
import os, signal, sys, time
for number, pause_s in ((signal.SIGSTOP, {STALL_S}), (signal.SIGCONT, 0)):
    os.killpg(int(sys.argv[1]), number)
    time.sleep(pause_s)
'''

def stall():
    "The whole session stands still, as where a hypervisor takes the processors."
    command = [sys.executable, "-c", STALL, str(os.getpgrp())]
    subprocess.run(command, start_new_session=True)

def times(name):
    "How often this was asked for, this time included."
    with (HERE / name).open("a+") as file:
        file.write("x")
    return len((HERE / name).read_text())

pytestmark = pytest.mark.live
"""
"""Head of the tests in an inner session."""


def play(folder: Path, tests: str, *options: str) -> str:
    """Returns the output of an inner pytest session with the rules of these tests. `folder` records
    how often tests and fixtures were started."""
    (folder / "test_planted.py").write_text(STALLED + tests)
    ours = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    ours.pop("SLAMBED_TEST_PLACE", None)
    done = subprocess.run(
        [
            *(sys.executable, "-m", "pytest", "-p", "conftest", "-p", "no:cacheprovider"),
            *("-q", f"--rootdir={folder}", "-o", "timeout=60", "-o", "markers=live", *options),
            folder / "test_planted.py",
        ],
        env=ours | {"PYTHONPATH": str(Path(__file__).parents[1])},
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=120,
        start_new_session=True,
    )
    return done.stdout


def began(folder: Path) -> dict[str, int]:
    return {
        path.name: path.stat().st_size
        for path in folder.iterdir()
        if path.is_file() and path.suffix == ""
    }


SPOILED = """
@pytest.fixture(scope="module")
def campaign():
    if times("campaign") == 1:
        stall()
        yield "spoiled"
    else:
        yield "good"
    times("taken down")

def test_of_the_campaign(campaign): times("first")

def test_of_its_result(campaign):
    times("second")
    assert campaign == "good"

def test_stalled_itself():
    if times("itself") == 1:
        stall()
        raise ValueError("it came too late, " + "and in two lines\\n")

def test_with_a_fault():
    times("fault")
    assert False, "a fault of ours"
"""


@pytest.mark.live
@pytest.mark.parametrize("options", [(), ("-n", "2", "--dist", "loadfile")], ids=["alone", "xdist"])
def test_a_failure_is_repeated_only_where_the_host_was_late(
    tmp_path: Path, options: Sequence[str]
) -> None:
    """A result of a module's campaign is judged by when that ran, and a repetition runs it
    again."""
    out = play(tmp_path, SPOILED, *options)
    assert "1 failed, 3 passed" in out, out
    assert began(tmp_path) == {
        "campaign": 2, "taken down": 2, "first": 1, "second": 2, "itself": 2, "fault": 1,
    }, out  # fmt: skip
    reported = [line for line in out.splitlines() if line.startswith("repeated: ")]
    assert len(reported) == 3, out
    result, itself = "test_planted.py::test_of_its_result", "test_planted.py::test_stalled_itself"
    assert reported[0].startswith(
        f"repeated: 2 live tests because the host was late ({result}, {itself}; at most largest nap"
    )
    assert reported[1].startswith(
        f"repeated: {result} after AssertionError: assert 'spoiled' == 'good"
    )
    assert reported[2].startswith(
        f"repeated: {itself} after ValueError: it came too late, and in two"
    )
    for line in reported:
        nap_ms = int(line.partition("largest nap ")[2].split()[0])
        assert 0.9 * 1e3 * STALL_S < nap_ms < 2e3 * STALL_S, line


ENDLESS = """
def test_that_always_fails():
    times("fails")
    stall()
    assert False, "once more"

@pytest.mark.timeout(2)
def test_that_never_ends():
    times("hangs")
    stall()
    while True:
        time.sleep(0.01)
"""


@pytest.mark.live
def test_nothing_is_repeated_for_ever(tmp_path: Path) -> None:
    """Three attempts are enough, and one at what meets its time limit."""
    out = play(tmp_path, ENDLESS)
    assert "2 failed" in out and "the limit of 2 s is over" in out, out
    assert began(tmp_path) == {"fails": 3, "hangs": 1}, out
    assert "repeated: 1 live tests" in out and out.count("after AssertionError: once more") == 2


def look(began_s: float, ended_s: float, **measured: float | None) -> Look:
    return Look(began_s, ended_s, **({"nap_ms": 1.0, "stolen_s": 0.0, "waited_s": 0.5} | measured))


@pytest.mark.parametrize(
    ("measured", "late"),
    [
        ({}, False),
        ({"nap_ms": NAP_MS + 1}, True),
        ({"nap_ms": NAP_MS - 1}, False),
        ({"stolen_s": STEAL_SHARE + 0.01}, True),
        ({"stolen_s": STEAL_SHARE - 0.01}, False),
        ({"waited_s": 1.0}, False),
        ({"waited_s": None}, False),
    ],
)
def test_each_measure_reports_a_late_host(measured: dict[str, float | None], late: bool) -> None:
    watch = Watch()
    watch.looks = [look(0, 1), look(1, 2, **measured), look(2, 3)]
    assert watch.lateness([Window(1.2, 1.9)]).is_late == late
    # Lateness outside of a test does not excuse it.
    assert not watch.lateness([Window(0, 1), Window(2, 2.5)]).is_late
    assert not watch.lateness([]).is_late


@pytest.mark.parametrize(
    ("seconds", "share", "late"),
    [
        (PRESSURE_S + 1, PRESSURE_SHARE + 0.01, True),
        (PRESSURE_S + 1, PRESSURE_SHARE - 0.01, False),
        (PRESSURE_S - 1, 1.0, False),
    ],
)
def test_pressure_reports_a_late_host_where_it_lasts(
    seconds: float, share: float, late: bool
) -> None:
    watch = Watch()
    watch.looks = [look(second, second + 1, waited_s=share) for second in range(int(seconds))]
    assert watch.lateness([Window(0, seconds)]).is_late == late


def test_a_kernel_without_pressure_is_reported() -> None:
    assert str(Lateness(120.4, 0.012)) == "largest nap 120 ms, steal 1.2%, pressure unknown"


def test_a_watcher_that_somebody_ended_is_started_again() -> None:
    watch = Watch()
    try:
        watch.start()
        assert watch.process is not None
        watch.process.kill()
        watch.process.wait()
        watch.ask()
        assert watch.process is None
        seen = len(watch.looks)
        watch.start()
        assert len(watch.looks) > seen
    finally:
        watch.close()


def test_a_watcher_that_does_not_answer_is_late_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    watch, began_s = Watch(), time.monotonic()
    try:
        watch.start()
        assert watch.process is not None
        watch.process.send_signal(signal.SIGSTOP)
        monkeypatch.setattr(host_late, "PATIENCE_S", 0.2)
        watch.ask()
        assert watch.lateness([Window(began_s, time.monotonic())]).is_late
        assert watch.process is None
    finally:
        watch.close()


@pytest.mark.parametrize(
    ("reason", "in_time", "late"),
    [
        ("link: median RTT error 60.12 ms is above 50 ms", False, False),
        ("RTT error p99 60.12 ms is above 50 ms", False, False),
        ("link: only 60% of the RTT probes came back (at least 80% wanted)", False, False),
        ("the host stalled the mobile node for 150 ms, above 100 ms", False, False),
        ("the mobile node waited for a processor for 90% of the time", False, False),
        ("the edge's freeze came at 2.7 s, not at 2.0 s", None, False),
        ("the end of the link's cut came at 4.7 s, not at 4.0 s", None, False),
        ("the RTT of the link was not measured", None, False),
        ("link: no RTT was measured", None, False),
        ("the mobile node was killed from outside (signal 9, SIGKILL)", None, None),
        ("", None, None),
    ],
)
def test_what_speaks_against_a_run_must_be_the_hosts_part(
    reason: str, in_time: bool | None, late: bool | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a watch, a test that needs it fails."""
    summary = {"valid": False, "invalid_reason": reason, "attempts": 3}
    for was_late, judged in ((False, in_time), (True, late)):
        monkeypatch.setattr(harness_parts, "is_late", partial(bool, was_late))
        if judged is None:
            with pytest.raises(AssertionError):
                is_valid_run(summary)
        else:
            assert is_valid_run(summary) == judged
