# SPDX-License-Identifier: Apache-2.0
"""Other software's environment: a sourced ROS, an activated conda, an unreadable home."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from harness_parts import needs_root

from slambed.errors import ExitCode
from slambed.isolation import OURS
from slambed.native import repository_root

STARTED = "from slambed.start import main; main()"


@pytest.fixture
def theirs(tmp_path: Path) -> Path:
    """Packages that fail on import."""
    for name in ("numpy", "typer", "docker"):
        (tmp_path / "ros" / name).mkdir(parents=True)
        (tmp_path / "ros" / name / "__init__.py").write_text("raise ImportError('theirs')")
    return tmp_path / "ros"


def started(*arguments: str, **environment: str) -> tuple[int, str, str]:
    done = subprocess.run(
        [sys.executable, "-c", STARTED, *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        env=os.environ | environment,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("order", ["{theirs}:{ours}", "{ours}:{theirs}", "{theirs}::{ours}"])
def test_packages_of_pythonpath_are_left_out_and_the_doctor_says_so(
    theirs: Path, order: str
) -> None:
    path = order.format(theirs=theirs, ours=OURS)
    code, out, err = started("doctor", PYTHONPATH=path, COLUMNS="400")
    assert code in (ExitCode.OK, ExitCode.ENVIRONMENT) and not err
    line = next(line for line in out.splitlines() if " python " in line)
    assert f"code in {repository_root()}" in line
    assert f"other software's and are left out: {theirs}" in " ".join(line.split())


def test_what_a_command_starts_is_isolated_too(theirs: Path) -> None:
    code = (
        "import os; from slambed.isolation import isolate; isolate();"
        "import numpy; print(os.environ.get('PYTHONPATH'))"
    )
    for given, left in ((f"{theirs}:{OURS}", str(OURS)), (f"{OURS}", str(OURS))):
        completed = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            env=os.environ | {"PYTHONPATH": given},
        )
        assert completed.stdout.rstrip("\n") == left


LEFT_OUT = 'source "$1"; echo "PATH=$PATH CXX=${CXX:-} CPATH=${CPATH:-}"; own_compiler'


def built_with(**environment: str) -> list[str]:
    script = repository_root() / "tools" / "environment.sh"
    completed = subprocess.run(
        ["bash", "-euc", LEFT_OUT, "bash", script],
        capture_output=True,
        text=True,
        check=True,
        env={"PATH": "/opt/conda/bin:/usr/bin:/bin"} | environment,
    )
    return completed.stdout.splitlines()


def test_a_build_leaves_other_software_out_and_says_so() -> None:
    assert built_with() == ["PATH=/opt/conda/bin:/usr/bin:/bin CXX= CPATH="]
    ros = built_with(CMAKE_PREFIX_PATH="/opt/ros", CPATH="/opt/ros/include", PYTHONPATH="/opt")
    message = "left out of the build, other software's: PYTHONPATH CPATH CMAKE_PREFIX_PATH"
    assert ros == [message, "PATH=/opt/conda/bin:/usr/bin:/bin CXX= CPATH="]
    conda = built_with(
        CONDA_PREFIX="/opt/conda", CXX="/opt/conda/bin/c++", CXXFLAGS="-march=nocona"
    )
    message = "left out of the build, other software's: CXX CXXFLAGS /opt/conda/bin"
    assert conda == [message, "PATH=/usr/bin:/bin CXX= CPATH="]


def test_a_compiler_of_ones_own_is_taken_and_reported() -> None:
    assert built_with(CXX="g++-13", CXXFLAGS="-g")[-1] == "CXX=g++-13 CXXFLAGS=-g "


FONTS = """
import os
from slambed.commands.font_caches import settle_font_caches
os.setgroups([]); os.setgid(65534); os.setuid(65534)
settle_font_caches()
place = os.environ["XDG_CACHE_HOME"]
assert os.path.isdir(place) and os.environ["MPLCONFIGDIR"] == place
print(place, os.environ["SLAMBED_CACHE"])
"""


@needs_root
def test_a_home_that_is_closed_gets_no_warnings_of_fonts(tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir(mode=0o755)
    unset = ("MPLCONFIGDIR", "XDG_CACHE_HOME", "SLAMBED_CACHE")
    environment = {k: v for k, v in os.environ.items() if k not in unset} | {"HOME": str(home)}
    completed = subprocess.run(
        [sys.executable, "-c", FONTS], capture_output=True, text=True, check=False, env=environment
    )
    assert (completed.returncode, completed.stderr) == (0, ""), completed.stderr
    place, cache = completed.stdout.split()
    assert cache == str(home / ".cache" / "slambed") and not Path(place).exists()
