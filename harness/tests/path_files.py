# SPDX-License-Identifier: Apache-2.0
"""Camera paths with more digits than our own writer uses, like those of other programs."""

from pathlib import Path

import numpy as np

from slambed.data.trajectory import Trajectory


def write_path(path: Path, trajectory: Trajectory) -> None:
    """Writes TUM's format with enough digits for an exact round trip."""
    np.savetxt(path, trajectory.rows(), fmt=["%.9f"] + ["%.9g"] * 7)
