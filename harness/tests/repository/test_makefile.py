# SPDX-License-Identifier: Apache-2.0
"""What `make` would call for a user who is neither root nor in the group docker."""

import subprocess

import pytest

from slambed.native import repository_root


def would_call(target: str, engine: str) -> str:
    """Returns the commands of a dry run of make."""
    command = ["make", "--dry-run", target, f"ENGINE={engine}", "UNPRIVILEGED=1000"]
    done = subprocess.run(
        command, capture_output=True, text=True, check=True, cwd=repository_root()
    )
    return done.stdout


@pytest.mark.parametrize("target", ["experiment", "paper", "data", "doctor"])
def test_virtual_runs_need_no_sudo(target: str) -> None:
    assert "sudo --preserve-env" in would_call(target, "local")
    calls = would_call(target, "virtual")
    assert "slambed" in calls and "sudo" not in calls


def test_the_engine_reaches_build_and_run() -> None:
    calls = " ".join(would_call("experiment", "virtual").split())
    assert "tools/build.sh virtual" in calls and "run quickstart --engine virtual" in calls
