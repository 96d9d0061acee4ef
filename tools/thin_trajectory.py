#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes a camera path of catalog/datasets/paths/ from a TUM ground truth: every nth pose, and its
source.

    tools/thin_trajectory.py groundtruth.txt fr3_long_office_household 4 > FILE

Kept lines are unchanged. The generator smooths a path over 50 ms, so 25 poses per second are as
good as 100.
"""

import hashlib
import sys
from pathlib import Path

URL = "https://cvg.cit.tum.de/data/datasets/rgbd-dataset"


def thinned(source: Path, name: str, every: int) -> str:
    """Returns the path file: a header with attribution and recipe, every nth pose and the last."""
    content = source.read_bytes()
    poses = [line for line in content.decode().splitlines() if line and not line.startswith("#")]
    kept = poses[::every]
    if kept[-1] != poses[-1]:
        kept.append(poses[-1])
    header = [
        f"Camera path of TUM RGB-D {name}:",
        f"every pose no. 1 + {every} n of its ground truth, and the last",
        f"source: groundtruth.txt of {name}, {URL}",
        f"sha256 of it: {hashlib.sha256(content).hexdigest()}",
        "by: TUM Computer Vision Group: J. Sturm, N. Engelhard, F. Endres, W. Burgard, D. Cremers,",
        "    A Benchmark for the Evaluation of RGB-D SLAM Systems, IROS 2012",
        "license: CC BY 4.0, https://creativecommons.org/licenses/by/4.0/; changed: thinned",
        f"made by: tools/thin_trajectory.py groundtruth.txt {name} {every}",
        "timestamp tx ty tz qx qy qz qw (camera to world)",
    ]
    return "\n".join([f"# {line}" for line in header] + kept) + "\n"


if __name__ == "__main__":
    if len(sys.argv) != 4 or not sys.argv[3].isdigit() or int(sys.argv[3]) < 1:
        sys.exit("error: thin_trajectory.py GROUNDTRUTH NAME EVERY")
    sys.stdout.write(thinned(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])))
