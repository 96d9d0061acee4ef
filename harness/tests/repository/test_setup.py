# SPDX-License-Identifier: Apache-2.0
"""Setup of a machine: apt locked by another process, Python without packages."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from slambed.native import repository_root
from slambed.spec.software import source_hash

APT = """#!/bin/sh
# An apt whose lock is held until it has been called {busy} times.
echo "$@" >>{folder}/calls
if [ "$(wc -l <{folder}/calls)" -le {busy} ]; then
  echo "E: {refusal}" >&2
  exit 100
fi
"""
LOCKED = "Could not get lock /var/lib/dpkg/lock-frontend. It is held by process 1 (apt)"


def install(folder: Path, busy: int, refusal: str, wait_s: int = 60) -> tuple[int, str, list[str]]:
    tools = {
        "apt-get": APT.format(folder=folder, busy=busy, refusal=refusal),
        "dpkg-query": "#!/bin/sh\nexit 1\n",
        "sudo": '#!/bin/sh\nexec "$@"\n',
    }
    for name, text in tools.items():
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    done = subprocess.run(
        [repository_root() / "tools" / "setup.sh", "live"],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ
        | {"PATH": f"{folder}:{os.environ['PATH']}", "SLAMBED_APT_WAIT_S": str(wait_s)}
        | {"SLAMBED_APT_PAUSE_S": "0"},
    )
    calls = (folder / "calls").read_text().splitlines()
    return done.returncode, done.stdout + done.stderr, calls


def test_another_apt_is_waited_for(tmp_path: Path) -> None:
    code, reported, calls = install(tmp_path, 2, LOCKED)
    assert code == 0, reported
    assert reported.count("waiting for another apt to end") == 1
    assert [call.split()[1] for call in calls] == ["update"] * 3 + ["install"]
    assert "iproute2" in calls[-1]


BROKEN = "Sub-process /usr/bin/dpkg returned an error code (1)"
UNREACHED = "Failed to fetch http://deb.debian.org/debian/dists/bookworm/InRelease"


@pytest.mark.parametrize("refusal", [BROKEN, UNREACHED])
def test_what_fails_is_tried_three_times(tmp_path: Path, refusal: str) -> None:
    code, reported, calls = install(tmp_path, 2, refusal)
    assert code == 0, reported
    assert [line for line in reported.splitlines() if "attempt" in line] == [
        "apt-get update failed; attempt 2 of 3 in 0 s",
        "apt-get update failed; attempt 3 of 3 in 0 s",
    ]
    assert [call.split()[1] for call in calls] == ["update"] * 3 + ["install"]


@pytest.mark.parametrize(
    ("refusal", "wait_s", "part"),
    [
        (LOCKED, 0, "another apt has held its lock"),
        (UNREACHED, 60, "Failed to fetch"),
        (BROKEN, 60, "apt-get update failed three times"),
    ],
)
def test_what_waiting_does_not_help_ends_with_code_3(
    tmp_path: Path, refusal: str, wait_s: int, part: str
) -> None:
    code, reported, _ = install(tmp_path, 99, refusal, wait_s)
    assert code == 3 and part in reported


RETRIED = """
source "{root}/tools/retry.sh"
sleep() {{ :; }}
work() {{ echo called >>{folder}/calls; [ "$(wc -l <{folder}/calls)" -gt {failures} ]; }}
thrice work
"""


@pytest.mark.parametrize(("failures", "calls", "code"), [(0, 1, 0), (2, 3, 0), (3, 3, 1)])
def test_what_is_loaded_from_a_network_is_tried_three_times(
    tmp_path: Path, failures: int, calls: int, code: int
) -> None:
    script = RETRIED.format(root=repository_root(), folder=tmp_path, failures=failures)
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    assert len((tmp_path / "calls").read_text().splitlines()) == calls


def test_a_build_needs_nothing_but_python_to_name_its_sources() -> None:
    """tools/build.sh and test.sh use the host's Python, which may have no packages."""
    done = subprocess.run(
        [sys.executable, "-S", "-m", "slambed.spec.software"],
        env={"PYTHONPATH": str(repository_root() / "harness")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout.strip(), done.stderr) == (source_hash(), "")


def test_a_page_that_does_not_exist_is_not_renewed_in_silence() -> None:
    done = subprocess.run(
        [sys.executable, repository_root() / "tools" / "tutorials.py", "own-slam.md"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr == "error: no page own-slam.md in docs/tutorials\n"


@pytest.mark.skipif(os.geteuid() != 0, reason="needs root")
def test_a_debian_is_not_made_over_files_of_somebody(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("words")
    done = subprocess.run(
        [repository_root() / "tools" / "root.sh", "bookworm", f"{tmp_path}/"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (
        2,
        f"error: {tmp_path} is not empty; give a new folder\n",
    )
    assert (tmp_path / "thesis.tex").exists()
