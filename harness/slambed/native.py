# SPDX-License-Identifier: Apache-2.0
"""Finds the files beside this package and the C++ programs: slambed-node, -sim, -relay, -pace,
-synth and -play."""

import hashlib
import os
from pathlib import Path

from slambed.errors import environment_error

SIMULATION = "slambed-sim"
"""The program of virtual runs; it also plays messages through a modeled link alone."""


CHECKOUT = "checkout"
"""Of an installed package: what a run needs of the checkout that it was made from (setup.py)."""


def repository_root() -> Path:
    """The checkout this package runs from, or what an installed package has of one; experiments,
    profiles, datasets and the sources of the programs lie in it."""
    package = Path(__file__).resolve().parent
    return package / CHECKOUT if is_installed() else package.parents[1]


def left_behind(file: Path) -> str:
    """What to do about a file of one's own, missing at `catalog/<kind>/<name>`, that still lies at
    `<kind>/<name>`, which was read until the catalog had a folder; empty where none lies there."""
    kind = file.parent
    former = kind.parent.parent / kind.name / file.name
    if kind.parent.name != "catalog" or not former.is_file():
        return ""
    return f"{former} is no longer read, move it to {kind}"


def is_installed() -> bool:
    """True for a package from a wheel, which must not write beside itself."""
    return (Path(__file__).resolve().parent / CHECKOUT).is_dir()


def cache_folder() -> Path:
    """$SLAMBED_CACHE, else $XDG_CACHE_HOME/slambed, else ~/.cache/slambed."""
    if configured := os.environ.get("SLAMBED_CACHE"):
        return Path(configured).expanduser()
    base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(base).expanduser() / "slambed"


def build_folder() -> Path:
    """Where programs are compiled: build/ of a checkout; for an installed package a folder in the
    cache, of its own for every place that it may be installed in."""
    root = repository_root()
    if not is_installed():
        return root / "build"
    return cache_folder() / "programs" / hashlib.sha256(bytes(root)).hexdigest()[:8]


def how_to_build() -> str:
    """The command, in quotes, for a line of an error."""
    return "'slambed setup'" if is_installed() else "'make build'"


def find_program(name: str) -> Path:
    """Path of a built program: $SLAMBED_BIN first, then where they are compiled."""
    folders = [build_folder() / "bin"]
    if configured := os.environ.get("SLAMBED_BIN"):
        folders.insert(0, Path(configured))
    for folder in folders:
        if (candidate := folder / name).is_file():
            return candidate
    raise environment_error(f"{name} is not built: not in {folders[0]}; run {how_to_build()}")
