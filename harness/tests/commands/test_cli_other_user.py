# SPDX-License-Identifier: Apache-2.0
"""Errors for a user who is not root and has no access to root's home or cache."""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from harness_parts import needs_root

from slambed.errors import ExitCode
from slambed.native import repository_root

pytestmark = needs_root
READ = ("catalog", "experiments", "netem_profiles", "papers", "harness/slambed")
AS_NOBODY = """
import os, pkgutil, importlib, sys
import slambed
# Python itself may lie where nobody else can read, so all of it is loaded before.
for module in pkgutil.walk_packages(slambed.__path__, "slambed."):
    importlib.import_module(module.name)
from slambed.commands.main import run_command
os.chdir(sys.argv[1])
os.setgroups([]); os.setgid(65534); os.setuid(65534)
sys.exit(run_command(sys.argv[2:]))
"""


@pytest.fixture(scope="module")
def checkout() -> Iterator[Path]:
    """A copy of the checkout that every user can read."""
    with tempfile.TemporaryDirectory(dir="/tmp", prefix="slambed-open-") as name:
        place, root = Path(name), repository_root()
        place.chmod(0o755)
        for part in READ:
            shutil.copytree(root / part, place / part, ignore=shutil.ignore_patterns("__pycache__"))
        for file in (root / "systems").rglob("*.yaml"):
            (place / file.relative_to(root)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, place / file.relative_to(root))
        (place / "own").mkdir(mode=0o700)
        shutil.chown(place / "own", 65534, 65534)
        yield place


def as_nobody(checkout: Path, *arguments: str, **environment: str) -> tuple[int, str, str]:
    done = subprocess.run(
        [sys.executable, "-c", AS_NOBODY, str(checkout / "own"), *arguments],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(checkout / "harness")} | environment,
    )
    return done.returncode, done.stdout, done.stderr


def refused(code: int, checkout: Path, *arguments: str, **environment: str) -> str:
    """Returns the one line that a refused command prints."""
    found, _, stderr = as_nobody(checkout, *arguments, **environment)
    assert found == code, stderr
    lines = stderr.strip().splitlines()  # a progress bar cleared its line first
    assert len(lines) == 1 and lines[0].startswith("error: "), stderr
    return lines[0]


@pytest.mark.parametrize("engine", ["local", "docker", "auto"])
def test_without_permission_a_run_is_one_line(checkout: Path, engine: str) -> None:
    line = refused(
        ExitCode.ENVIRONMENT,
        checkout,
        "run",
        "quickstart",
        "--engine",
        engine,
        HOME=str(checkout / "own"),
    )
    assert "sudo" in line and "--engine virtual" in line


@pytest.mark.parametrize(
    "command",
    [
        ("run", "quickstart", "--engine", "local"),
        ("run", "quickstart", "--engine", "virtual"),
        ("run", "quickstart", "--check"),
        ("data", "list"),
        ("data", "prepare", "synthetic_room"),
    ],
)
def test_a_cache_that_is_closed_to_us_is_one_line(checkout: Path, command: tuple[str, ...]) -> None:
    home = Path(os.environ["HOME"])
    assert home.stat().st_mode & 0o777 == 0o700 and home.stat().st_uid == 0
    bin_folder = {"SLAMBED_BIN": str(checkout / "own")}
    for program in ("slambed-sim", "slambed-synth"):
        (checkout / "own" / program).write_text("#!/bin/sh\necho stand-in\n")
        (checkout / "own" / program).chmod(0o755)
    line = refused(ExitCode.ENVIRONMENT, checkout, *command, **bin_folder)
    assert f"{home}/.cache/slambed/prepared: Permission denied" in line
    assert "set SLAMBED_CACHE" in line


def test_the_closed_folders_are_reported(checkout: Path) -> None:
    code, out, _ = as_nobody(checkout, "data", "where")
    assert code == ExitCode.OK and "slambed/data  (permission denied)" in out
    code, out, _ = as_nobody(checkout, "doctor", COLUMNS="300")
    assert code in (ExitCode.OK, ExitCode.ENVIRONMENT) and "set SLAMBED_CACHE" in out
