# SPDX-License-Identifier: Apache-2.0
"""slambed: a reproducible testbed for edge-offloaded visual SLAM.

`Results` and `run` are for notebooks and scripts (docs/how-to/use-a-notebook.md).
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"
FOR_NOTEBOOKS = ("Results", "run")


def __getattr__(name: str) -> Any:
    """Imports the notebook names only when they are used, because every other module imports this
    file."""
    if name in FOR_NOTEBOOKS:
        return getattr(import_module("slambed.notebook"), name)
    raise AttributeError(f"module 'slambed' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted([*globals(), *FOR_NOTEBOOKS])
