# SPDX-License-Identifier: Apache-2.0
"""manifest.json: under which circumstances a run was made (docs/formats.md)."""

import json
import os
import platform
import subprocess
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from slambed import __version__
from slambed.engines.result import RunResult
from slambed.json_file import read_object
from slambed.native import repository_root
from slambed.spec.host_speed import cpu_model
from slambed.spec.matrix import RunSpec

# Packages whose version can change a figure in a result.
PACKAGES = ("numpy", "scipy", "pandas", "pyarrow", "pyroute2", "docker")


def manifest(
    spec: RunSpec, engine: dict[str, Any], result: RunResult, started_utc: str, load_1min: float
) -> dict[str, Any]:
    """All facts about one run that are not measurements."""
    commit, dirty = git_state()
    return {
        "run_key": spec.run_key,
        "experiment": spec.experiment,
        "cell": spec.cell,
        "repetition": spec.repetition,
        "spec": spec.model_dump(mode="json"),
        "outcome": result.outcome,
        "outcome_reason": result.reason,
        "distrust": result.distrust,
        "limits": {role: limits.as_json() for role, limits in result.limits.items()},
        "throttling": {role: counts.as_json() for role, counts in result.throttling.items()},
        "link": None if result.link is None else result.link.as_json(),
        "beside": None if result.beside is None else result.beside.as_json(),
        "commit": commit,
        "dirty": dirty,
        "image_id": None,
        "command": sys.argv,
        **engine,
        "sequence_checksum": spec.sequence_checksum,
        "seed": spec.seed,
        "kernel": platform.release(),
        "cpu_model": cpu_model(),
        "cores": os.cpu_count(),
        "load_1min": load_1min,
        "started_utc": started_utc,
        "versions": versions(),
    }


def add_plans(raw: Path, plans: dict[str, dict[str, str]]) -> None:
    """Which registered plans this attempt was made under. They are no part of what the run means:
    a run that an older plan had executed keeps saying so to whoever reuses it."""
    path = raw / "manifest.json"
    if (facts := read_object(path)) is not None:
        path.write_text(json.dumps(facts | {"plans": plans}, indent=1, allow_nan=False) + "\n")


@cache
def git_state() -> tuple[str | None, bool | None]:
    """Commit of the checkout and whether tracked files differ from it; None outside of git."""
    root = str(repository_root())
    # Under sudo the checkout belongs to another user, which git refuses without this.
    git = ["git", "-c", f"safe.directory={root}", "-C", root]
    try:
        commit = subprocess.run(
            [*git, "rev-parse", "HEAD"], capture_output=True, text=True, check=True
        ).stdout.strip()
        changes = subprocess.run(
            [*git, "status", "--porcelain", "--untracked-files=no"],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        return None, None
    return commit, bool(changes.strip())


@cache
def versions() -> dict[str, str | None]:
    """slambed, Python and the packages that compute figures."""
    found: dict[str, str | None] = {
        "slambed": __version__,
        "python": platform.python_version(),
    }
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = None
    return found
