# SPDX-License-Identifier: Apache-2.0
"""Finds the C++ programs: slambed-node, -sim, -relay, -pace, -synth and -play."""

import os
from pathlib import Path

from slambed.errors import environment_error

SIMULATION = "slambed-sim"
"""The program of virtual runs; it also plays messages through a modelled link alone."""


def repository_root() -> Path:
    """The checkout this package runs from; experiments, profiles and datasets lie in it."""
    return Path(__file__).resolve().parents[2]


def find_program(name: str) -> Path:
    """Path of a built program: $SLAMBED_BIN first, then build/bin of the checkout."""
    folders = [repository_root() / "build" / "bin"]
    if configured := os.environ.get("SLAMBED_BIN"):
        folders.insert(0, Path(configured))
    for folder in folders:
        if (candidate := folder / name).is_file():
            return candidate
    raise environment_error(f"{name} is not built: not in {folders[0]}; run 'make build'")
