# SPDX-License-Identifier: Apache-2.0
"""Other software's packages stay outside: a sourced ROS, or any PYTHONPATH, would put its numpy
before the one that this environment was made with."""

import os
import site
import sys
from pathlib import Path

OURS = Path(__file__).resolve().parents[1]
"""Where this package lies. Whoever names it in PYTHONPATH wants this very code."""
left_out: list[str] = []
"""Folders of PYTHONPATH that nothing is imported from, for the doctor."""


def isolate() -> None:
    """For this process and all that it starts, before anything but the standard library is there.
    What an interpreter imports by itself (sitecustomize) has been by then."""
    given = [entry for entry in os.environ.pop("PYTHONPATH", "").split(os.pathsep) if entry]
    usual = {place.resolve() for place in (*map(Path, site.getsitepackages()), OURS)}
    left_out[:] = [entry for entry in given if Path(entry).resolve() not in usual]
    outside = {Path(entry).resolve() for entry in left_out}
    sys.path[:] = [entry for entry in sys.path if Path(entry).resolve() not in outside]
    if kept := [entry for entry in given if entry not in left_out]:
        os.environ["PYTHONPATH"] = os.pathsep.join(kept)
