# SPDX-License-Identifier: Apache-2.0
"""Virtual runs give the same bytes on CPUs for which the C library selects other functions."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from virtual_parts import (
    Quiet,
    fingerprints,
    make_sequence,
    needs_programs,
    plan_of,
    played_of,
    write_experiment,
)

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.plan import Plan
from slambed.campaign.processes import ProcessExecutor
from slambed.campaign.runner import Runner
from slambed.native import find_program

OLDER_PROCESSOR = "glibc.cpu.hwcaps=-FMA,-AVX2"
"""Makes glibc select the function variants of an older x86-64 CPU."""
SAME_CALLS = "import math\nprint([math.exp(i / 977).hex() for i in range(20000)])"


def of_libm(tunables: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", SAME_CALLS],
        env={**os.environ, "GLIBC_TUNABLES": tunables},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


def has_variants() -> bool:
    """Returns whether glibc has variants; otherwise nothing can differ on this CPU."""
    flags = Path("/proc/cpuinfo").read_text("ascii") if Path("/proc/cpuinfo").exists() else ""
    return os.uname().machine == "x86_64" and " fma " in flags


def older_processor(folder: Path) -> Path:
    """Creates a wrapper that runs slambed-sim like on an older CPU."""
    path = folder / "slambed-sim"
    program = find_program("slambed-sim")
    path.write_text(f'#!/bin/sh\nGLIBC_TUNABLES={OLDER_PROCESSOR} exec "{program}" "$@"\n')
    path.chmod(0o755)
    return path


def play(plan: Plan, path: Path, program: Path) -> dict[str, str]:
    folder = ResultFolder(path)
    folder.create()
    executor = ProcessExecutor(played_of(plan), program, path / "features", 1)
    verdict = Runner(folder, Ledger(path / "ledger.jsonl"), executor).run(plan.specs, Quiet())
    assert (verdict.done, verdict.valid) == (len(plan.specs), len(plan.specs))
    return fingerprints(folder)


@pytest.mark.skipif(not has_variants(), reason="this C library has one variant of its functions")
def test_the_c_library_does_differ_on_an_older_processor() -> None:
    """Otherwise the test below would be meaningless."""
    assert of_libm("") != of_libm(OLDER_PROCESSOR)


@needs_programs
def test_the_program_says_what_its_results_hang_on() -> None:
    done = subprocess.run(
        [find_program("slambed-sim"), "--machine"], capture_output=True, text=True, check=True
    )
    machine = json.loads(done.stdout)
    compared = os.uname().machine in ("x86_64", "aarch64")
    other = set() if compared else {"architecture"}
    assert machine.keys() == {"compiler", "standard_library", "libraries"} | other
    assert "unknown" not in machine.values() and re.search(r"eigen \d.*turbojpeg \d", done.stdout)


@needs_programs
def test_an_older_processor_gives_the_same_bytes(tmp_path: Path) -> None:
    """Covers everything that could differ: heavy-tailed jitter, loss bursts, tracking, mapping
    and an edge."""
    plan = plan_of(write_experiment(tmp_path, make_sequence(tmp_path / "walk"), runs=1))
    here = play(plan, tmp_path / "here", find_program("slambed-sim"))
    older = play(plan, tmp_path / "older", older_processor(tmp_path))
    assert len(here) > 2 * len(plan.specs)
    assert older == here
