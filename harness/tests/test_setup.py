# SPDX-License-Identifier: Apache-2.0
"""A machine that is being set up: an apt that another one holds up, a Python without packages."""

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
        | {"PATH": f"{folder}:{os.environ['PATH']}", "SLAMBED_APT_WAIT_S": str(wait_s)},
    )
    calls = (folder / "calls").read_text().splitlines()
    return done.returncode, done.stdout + done.stderr, calls


def test_another_apt_is_waited_for(tmp_path: Path) -> None:
    code, told, calls = install(tmp_path, 2, LOCKED)
    assert code == 0, told
    assert told.count("waiting for another apt to end") == 1
    assert [call.split()[1] for call in calls] == ["update"] * 3 + ["install"]
    assert "iproute2" in calls[-1]


BROKEN = "Sub-process /usr/bin/dpkg returned an error code (1)"


def test_an_install_whose_packages_another_apt_removed_is_repeated_once(tmp_path: Path) -> None:
    code, told, calls = install(tmp_path, 1, BROKEN)
    assert code == 0, told
    assert told.count("once more") == 1
    assert [call.split()[1] for call in calls] == ["update"] * 2 + ["install"]


@pytest.mark.parametrize(
    ("refusal", "wait_s", "part"),
    [
        (LOCKED, 0, "another apt has held its lock"),
        ("Unable to fetch", 60, "Unable to fetch"),
        (BROKEN, 60, "apt-get update failed"),
    ],
)
def test_what_waiting_does_not_help_ends_with_code_3(
    tmp_path: Path, refusal: str, wait_s: int, part: str
) -> None:
    code, told, _ = install(tmp_path, 99, refusal, wait_s)
    assert code == 3 and part in told


def test_a_build_needs_nothing_but_python_to_name_its_sources() -> None:
    """tools/build.sh and test.sh ask the host's own Python, which may have no package at all."""
    done = subprocess.run(
        [sys.executable, "-S", "-m", "slambed.spec.software"],
        env={"PYTHONPATH": str(repository_root() / "harness")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout.strip(), done.stderr) == (source_hash(), "")
