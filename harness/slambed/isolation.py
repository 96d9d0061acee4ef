# SPDX-License-Identifier: Apache-2.0
"""Removes foreign packages from sys.path: a sourced ROS, or any PYTHONPATH, would put its numpy
before the one of this environment."""

import os
import site
import sys
from pathlib import Path

OURS = Path(__file__).resolve().parents[1]
"""Folder of this package; in PYTHONPATH it is kept, because the user asks for this very code."""
left_out: list[str] = []
"""Ignored folders of PYTHONPATH, shown by the doctor."""


def isolate() -> None:
    """Isolates this process and its children; call it before any import beyond the standard
    library. Modules that Python itself imports at startup (sitecustomize) are already loaded by
    then."""
    given = [entry for entry in os.environ.pop("PYTHONPATH", "").split(os.pathsep) if entry]
    usual = {place.resolve() for place in (*map(Path, site.getsitepackages()), OURS)}
    left_out[:] = [entry for entry in given if Path(entry).resolve() not in usual]
    outside = {Path(entry).resolve() for entry in left_out}
    sys.path[:] = [entry for entry in sys.path if Path(entry).resolve() not in outside]
    if kept := [entry for entry in given if entry not in left_out]:
        os.environ["PYTHONPATH"] = os.pathsep.join(kept)
