# SPDX-License-Identifier: Apache-2.0
"""One suite at a time on a host: a second one waits, and a CI run that is ended leaves nothing."""

import contextlib
import fcntl
import os
import signal
import subprocess
from pathlib import Path

import psutil
import pytest
from checkout import needs_git
from waiting import until

from slambed.native import repository_root

MAKEFILE = """\
test:
\t@setsid sleep 600 & sleep 600
"""


def test_a_second_suite_waits_for_the_first() -> None:
    folder = os.open("/tmp", os.O_RDONLY)
    # The suite that runs this test holds the lock already; alone, the test takes it.
    with contextlib.suppress(BlockingIOError):
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
    second = subprocess.Popen(
        ["bash", repository_root() / "tools/test.sh"], stdout=subprocess.PIPE, text=True
    )
    try:
        assert second.stdout is not None
        lines = iter(second.stdout.readline, "")
        assert "waiting: the tests of another checkout run on this host\n" in lines
        assert second.poll() is None
    finally:
        for process in (*psutil.Process(second.pid).children(), second):
            process.kill()
        second.wait()
        os.close(folder)


@needs_git
@pytest.mark.parametrize("signum", [signal.SIGTERM, signal.SIGHUP])
def test_a_ci_run_that_is_ended_leaves_no_process_and_no_folder(
    tmp_path: Path, signum: signal.Signals
) -> None:
    checkout, place = tmp_path / "checkout", tmp_path / "place"
    (checkout / ".ci").mkdir(parents=True)
    place.mkdir()
    (checkout / ".ci/run").write_text((repository_root() / ".ci/run").read_text())
    (checkout / "Makefile").write_text(MAKEFILE)
    author = ("-c", "user.name=a", "-c", "user.email=a@b")
    for words in (("init", "-q"), ("add", "-A"), (*author, "commit", "-qm", "all")):
        subprocess.run(["git", *words], cwd=checkout, check=True)
    running = subprocess.Popen(
        ["bash", ".ci/run"], cwd=checkout, env={**os.environ, "TMPDIR": str(place)}
    )

    def sleeping() -> list[psutil.Process]:
        return [
            p
            for p in psutil.process_iter(["name", "cwd"])
            if p.info["name"] == "sleep" and str(p.info["cwd"]).startswith(str(place))
        ]

    until(lambda: len(sleeping()) == 2, "both processes of the clone run")
    running.send_signal(signum)
    assert running.wait(timeout=60) == 130
    assert not sleeping() and not list(place.iterdir())
