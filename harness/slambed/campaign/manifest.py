# SPDX-License-Identifier: Apache-2.0
"""manifest.json: the circumstances of a run (docs/reference/manifest.md)."""

import json
import os
import platform
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from slambed import __version__
from slambed.engines.python_packages import find_environment
from slambed.engines.result import RunResult
from slambed.files.json_file import read_object
from slambed.native import git, is_installed, repository_root
from slambed.records.board import BoardFacts
from slambed.records.manifest import EngineFacts, Manifest, RunHost
from slambed.spec.host_speed import cpu_model
from slambed.spec.run_spec import RunSpec

# Packages whose version can change a result.
PACKAGES = ("numpy", "scipy", "pandas", "pyarrow", "pyroute2", "docker")


def manifest(
    spec: RunSpec,
    engine: EngineFacts,
    command: list[str],
    result: RunResult,
    started_utc: str,
    load_1min: float,
    attempt: int,
    frames_offered: int | None,
) -> Manifest:
    """Returns all facts about one run that are known before its files are read. `command` is the
    user's command line."""
    commit, dirty = git_state()
    return Manifest(
        run_key=spec.run_key,
        experiment=spec.experiment,
        cell=spec.cell,
        repetition=spec.repetition,
        spec=spec,
        outcome=result.outcome,
        outcome_reason=result.reason,
        invalid_reasons=result.invalid_reasons,
        limits=result.limits,
        throttling=result.throttling,
        link=result.link,
        **of_board(result.board),
        sidecar=result.sidecar,
        commit=commit,
        dirty=dirty,
        tree=str(repository_root()),
        command=command,
        image_id=engine.image_id,
        # Facts that the engine does not set stay out of the file.
        **engine.model_dump(exclude={"image_id"}),
        sequence_checksum=spec.sequence_checksum,
        seed=spec.seed,
        kernel=platform.release(),
        cpu_model=cpu_model(),
        cores=os.cpu_count(),
        load_1min=load_1min,
        started_utc=started_utc,
        versions=versions(),
        **packages_of(spec),
        attempt=attempt,
        frames_offered=frames_offered,
    )


def packages_of(spec: RunSpec) -> dict[str, Any]:
    """Returns the installed Python packages of a run's system; nothing if it names none."""
    if spec.runtime is None or spec.runtime.python is None:
        return {}
    installed = find_environment(spec.runtime.python, Path(spec.system_folder))
    return {"python_packages": installed.versions}


def of_board(board: BoardFacts | None) -> dict[str, Any]:
    """Returns the board of a run's mobile node, also as the host that tables name."""
    if board is None:
        return {}
    return {"board": board, "host": RunHost(name=board.name, cpus=list(range(board.cores)))}


def add_plans(raw: Path, plans: dict[str, dict[str, str]]) -> None:
    """Adds the registered plans of this attempt. They are not part of the run key: a reused run
    keeps the plans under which it was executed."""
    add_facts(raw, {"plans": plans})


def add_facts(raw: Path, further: dict[str, Any]) -> None:
    """Adds or replaces facts that only the campaign knows."""
    path = raw / "manifest.json"
    if (facts := read_object(path)) is not None:
        path.write_text(json.dumps(facts | further, indent=1, allow_nan=False) + "\n")


def installed_commit() -> tuple[str | None, bool | None]:
    """Returns the commit of an installed package, as written by setup.py."""
    try:
        commit, _, state = (repository_root() / "commit").read_text().strip().partition(" ")
    except OSError:
        return None, None
    return commit or None, bool(state) if commit else None


@cache
def git_state() -> tuple[str | None, bool | None]:
    """Returns the commit of the checkout and whether tracked files differ; None outside of git."""
    if is_installed():
        return installed_commit()

    def answer(*command: str) -> str:
        ended = git(*command)
        ended.check_returncode()
        return ended.stdout.strip()

    try:
        return answer("rev-parse", "HEAD"), bool(
            answer("status", "--porcelain", "--untracked-files=no")
        )
    except (OSError, subprocess.CalledProcessError):
        return None, None


@cache
def versions() -> dict[str, str | None]:
    """Returns the versions of slambed, Python and the packages that compute metrics."""
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
