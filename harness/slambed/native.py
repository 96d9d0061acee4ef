# SPDX-License-Identifier: Apache-2.0
"""Finds the repository's files and the C++ programs: slambed-node, -sim, -relay, -pace, -synth and
-play."""

import hashlib
import os
import subprocess
from pathlib import Path

from slambed.errors import environment_error

SIMULATION = "slambed-sim"
"""The program of virtual runs; it also plays messages through a modeled link alone."""


CHECKOUT = "checkout"
"""Folder of an installed package with the files of the checkout that a run needs (setup.py)."""


def repository_root() -> Path:
    """Returns the checkout, or an installed package's copy of it. It has the experiments, profiles,
    datasets and C++ sources."""
    package = Path(__file__).resolve().parent
    return package / CHECKOUT if is_installed() else package.parents[1]


def git(*command: str) -> subprocess.CompletedProcess[str]:
    """Runs git in the checkout; OSError where git is not installed."""
    root = repository_root()
    return subprocess.run(
        # Under sudo the checkout belongs to another user, which git refuses without this option.
        ["git", "-c", f"safe.directory={root}", "-C", str(root), *command],
        capture_output=True,
        text=True,
        # An unpacked archive may lie in a repository of something else.
        env=os.environ | {"GIT_CEILING_DIRECTORIES": str(root.parent)},
    )


def left_behind(file: Path) -> str:
    """Returns advice for a user's file that is missing at `catalog/<kind>/<name>` but exists at the
    former place `<kind>/<name>`; empty where it does not."""
    kind = file.parent
    former = kind.parent.parent / kind.name / file.name
    if kind.parent.name != "catalog" or not former.is_file():
        return ""
    return f"{former} is no longer read, move it to {kind}"


def is_installed() -> bool:
    """Returns whether the package comes from a wheel; then it must not write into its own
    folder."""
    return (Path(__file__).resolve().parent / CHECKOUT).is_dir()


def cache_folder() -> Path:
    """Returns $SLAMBED_CACHE, else $XDG_CACHE_HOME/slambed, else ~/.cache/slambed."""
    if configured := os.environ.get("SLAMBED_CACHE"):
        return Path(configured).expanduser()
    base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(base).expanduser() / "slambed"


def brings_programs() -> bool:
    """Returns whether the package comes from a wheel of `make wheel`, which has the programs."""
    return is_installed() and (repository_root() / "build" / "bin").is_dir()


def build_folder() -> Path:
    """Returns the folder whose bin/ has the programs: build/ of a checkout, or of a wheel that
    brings them; for any other installed package, a folder in the cache that is unique to its
    install path."""
    root = repository_root()
    if not is_installed() or brings_programs():
        return root / "build"
    return cache_folder() / "programs" / hashlib.sha256(bytes(root)).hexdigest()[:8]


def how_to_build() -> str:
    """Returns the build command in quotes, for error messages."""
    return "'slambed setup'" if is_installed() else "'make build'"


def find_program(name: str) -> Path:
    """Returns the path of a built program: $SLAMBED_BIN first, then the build folder."""
    folders = [build_folder() / "bin"]
    if configured := os.environ.get("SLAMBED_BIN"):
        folders.insert(0, Path(configured))
    for folder in folders:
        if (candidate := folder / name).is_file():
            return candidate
    raise environment_error(f"{name} is not built: not in {folders[0]}; run {how_to_build()}")
