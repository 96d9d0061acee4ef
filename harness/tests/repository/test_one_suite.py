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


def test_folders_of_recordings_may_have_blanks(tmp_path: Path) -> None:
    suite = (repository_root() / "tools/test.sh").read_text()
    function = suite[suite.index("recordings() {") :].partition("\n}\n")[0] + "\n}\n"
    (tmp_path / "my data").mkdir()
    given = {**os.environ, "SLAMBED_DATA": f"{tmp_path}/my data:{tmp_path}/none:{tmp_path}"}
    given.pop("SLAMBED_TEST_RECORDINGS", None)
    found = subprocess.run(
        ["bash", "-uc", f"{function}recordings"],
        cwd=tmp_path, env=given, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert found.stdout == f"{tmp_path}/my data:{tmp_path}\n"


@needs_git
def test_a_ci_run_finds_recordings_in_folders_with_blanks(tmp_path: Path) -> None:
    checkout = committed(
        tmp_path, f'test:\n\t@echo "$$SLAMBED_TEST_RECORDINGS" >{tmp_path}/found\n'
    )
    (tmp_path / "my data").mkdir()
    given = {**os.environ, "TMPDIR": str(tmp_path), "SLAMBED_DATA": f"{tmp_path}/my data"}
    subprocess.run(["bash", ".ci/run"], cwd=checkout, env=given, check=True)
    assert (tmp_path / "found").read_text() == f"{tmp_path}/my data\n"


def committed(folder: Path, makefile: str) -> Path:
    """Returns a checkout of the CI's script and a Makefile."""
    checkout = folder / "checkout"
    (checkout / ".ci").mkdir(parents=True)
    (checkout / ".ci/run").write_text((repository_root() / ".ci/run").read_text())
    (checkout / "Makefile").write_text(makefile)
    author = ("-c", "user.name=a", "-c", "user.email=a@b")
    for words in (("init", "-q"), ("add", "-A"), (*author, "commit", "-qm", "all")):
        subprocess.run(["git", *words], cwd=checkout, check=True)
    return checkout


@needs_git
@pytest.mark.parametrize("signum", [signal.SIGTERM, signal.SIGHUP])
def test_a_ci_run_that_is_ended_leaves_no_process_and_no_folder(
    tmp_path: Path, signum: signal.Signals
) -> None:
    checkout, place = committed(tmp_path, MAKEFILE), tmp_path / "place"
    place.mkdir()
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
