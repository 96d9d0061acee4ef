# SPDX-License-Identifier: Apache-2.0
"""The lanes of tools/test.sh: a hanging lane is ended and named, and the others continue."""

import os
import signal
import subprocess
import time
from pathlib import Path

import psutil
import pytest
from waiting import until

from slambed.native import repository_root

SCRIPT = """
source "{root}/tools/steps.sh"
quick() {{ step one true; step two true; }}
{functions}
export -f step logged quick slow
start_lane slow {limit_s} slow
start_lane quick 60 quick
wait_for_lane quick show
wait_for_lane slow
finish
"""


def play(functions: str, limit_s: int = 60) -> subprocess.CompletedProcess[str]:
    """Runs a script of two lanes, the second of which has nothing to do."""
    script = SCRIPT.format(root=repository_root(), functions=functions, limit_s=limit_s)
    environment = {name: v for name, v in os.environ.items() if name != "SLAMBED_LANE_LIMIT_S"}
    environment["SLAMBED_KILL_AFTER_S"] = "1"
    return subprocess.run(
        ["bash", "-uc", script],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        timeout=60,
    )


def test_lanes_that_end_are_green() -> None:
    done = play("slow() { step three true; }")
    assert done.returncode == 0, done.stderr
    assert "== passed: " in done.stdout and "error" not in done.stdout + done.stderr
    assert {"one", "two", "three"} <= set(done.stdout.split())


def test_a_step_that_fails_is_named_and_the_others_go_on() -> None:
    done = play("slow() { step three false; step four true; }")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "error: failed: three"
    assert "== four" in done.stdout and "== failed: " in done.stdout


@pytest.mark.parametrize(
    ("hangs", "where"),
    [
        ('echo a.py::test_b >"$SLAMBED_STANDING/7"; sleep 99', "a.py::test_b"),
        (
            "echo '    Start 2: Map.Grows'; echo '    Start 3: Tracker.IsLost';"
            "echo '1/9 Test #2: Map.Grows .. Passed'; sleep 99",
            "Tracker.IsLost",
        ),
        ("trap '' TERM; sleep 99", "== three"),
    ],
    ids=["pytest", "ctest", "another step"],
)  # fmt: skip
def test_a_lane_that_hangs_is_ended_and_reports_where(hangs: str, where: str) -> None:
    began_s = time.monotonic()
    done = play(f"slow() {{ step three hang; }}; hang() {{ {hangs}; }}; export -f hang", limit_s=5)
    assert time.monotonic() - began_s < 50
    assert done.returncode == 1
    assert f"lane 'slow' was still running after 5 s and was ended; it stood at: {where}\n" in (
        done.stderr
    )
    assert done.stderr.splitlines()[-1] == "error: failed: lane slow"
    assert "== two" in done.stdout


def test_a_lane_that_dies_is_no_success() -> None:
    done = play("slow() { kill -9 $BASHPID; }")
    assert done.returncode == 1
    assert "lane 'slow' ended with status" in done.stderr


def test_lanes_end_with_the_script(tmp_path: Path) -> None:
    mark = tmp_path / "begun"
    functions = f"slow() {{ touch {mark}; sleep 98.7; }}"
    script = SCRIPT.format(root=repository_root(), functions=functions, limit_s=60)
    with subprocess.Popen(["bash", "-uc", script], stdout=subprocess.DEVNULL) as process:
        until(mark.exists, "the lane's beginning")
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=30) == 130

    def sleeper() -> bool:
        found = psutil.process_iter(["cmdline"])
        return any("98.7" in (p.info["cmdline"] or []) for p in found)

    until(lambda: not sleeper(), "the end of the lane")
