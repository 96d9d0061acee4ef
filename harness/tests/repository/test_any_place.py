# SPDX-License-Identifier: Apache-2.0
"""Unusual environments in which a virtual campaign must work."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from harness_parts import needs_root
from virtual_parts import fingerprints, make_sequence, needs_programs, write_experiment

from slambed.campaign.folder import ResultFolder
from slambed.errors import ExitCode

pytestmark = needs_programs
NOBODYS_UID = 54321
SLAMBED = [sys.executable, "-c", "from slambed.commands.main import main; main()"]
PLACES: dict[str, dict[str, str]] = {
    "usual": {},
    "no HOME": {"HOME": ""},
    "another locale and time zone": {"LC_ALL": "tr_TR.UTF-8", "TZ": "Asia/Kathmandu"},
    "optimized Python": {"PYTHONOPTIMIZE": "2"},
    "many threads": {"OMP_NUM_THREADS": "64"},
    "other libraries": {"LD_LIBRARY_PATH": "/nowhere"},
    "output of ASCII": {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"},
    "locale C without UTF-8": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    "a cell of a notebook": {"MPLBACKEND": "module://matplotlib_inline.backend_inline"},
}


@pytest.fixture(scope="module")
def experiment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("a path with a space")
    return write_experiment(folder, make_sequence(folder / "walk", 1), 1)


def narrow() -> None:
    """Sets a strict umask and a low limit of open files."""
    os.umask(0o077)
    resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))


def poses(experiment: Path, results: Path, **environment: str) -> dict[str, str]:
    command = [*SLAMBED, "run", str(experiment), "--engine", "virtual", "--no-figures"]
    command += ["--results", str(results)]
    environment["SLAMBED_CACHE"] = str(results.parent / "its cache")
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
        env={name: value for name, value in (os.environ | environment).items() if value},
        preexec_fn=narrow,
    )
    assert done.returncode in (ExitCode.OK, ExitCode.NOT_ALL_GOOD), done.stderr
    return fingerprints(ResultFolder(results / "walk"))


@pytest.fixture(scope="module")
def usual(experiment: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    return poses(experiment, tmp_path_factory.mktemp("usual results"))


IN_THE_GATE = ("no HOME", "output of ASCII", "locale C without UTF-8")


@pytest.mark.parametrize(
    "place",
    [
        pytest.param(name, marks=[] if name in IN_THE_GATE else pytest.mark.nightly)
        for name in PLACES
    ],
)
def test_the_same_bytes_come_out(
    experiment: Path, tmp_path: Path, usual: dict[str, str], place: str
) -> None:
    assert poses(experiment, tmp_path / "its results", **PLACES[place]) == usual


@pytest.mark.nightly
@needs_root
def test_one_cpu_and_the_results_of_a_user_who_does_not_exist(
    experiment: Path, tmp_path: Path, usual: dict[str, str]
) -> None:
    results = tmp_path / "its results"
    results.mkdir()
    os.chown(results, NOBODYS_UID, NOBODYS_UID)
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    try:
        assert poses(experiment, results) == usual
    finally:
        os.sched_setaffinity(0, before)
