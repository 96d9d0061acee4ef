# SPDX-License-Identifier: Apache-2.0
"""Camera paths with more digits than our own writer has, as programs of others write them."""

from pathlib import Path

import numpy as np

from slambed.data.trajectory import Trajectory


def write_path(path: Path, trajectory: Trajectory) -> None:
    """TUM's format, with enough digits to read the same poses back."""
    np.savetxt(path, trajectory.rows(), fmt=["%.9f"] + ["%.9g"] * 7)
