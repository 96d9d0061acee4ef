# SPDX-License-Identifier: Apache-2.0
"""One digest over all results of a run."""

import hashlib
from pathlib import Path

MOBILE_FILES = ("trajectory.txt", "trajectory_live.txt", "map.slm")
"""Files of the mobile node besides its events."""


def digest(folder: Path) -> str:
    """Returns SHA-256 over names and bytes of the results of a run, in its raw folder or its stored
    result.

    It covers summary, tables and trajectories but not the circumstances (manifest, logs), so
    identical virtual runs have equal digests.
    """
    files = [folder / "summary.json", *folder.glob("*.parquet")]
    files += [place / name for place in (folder, folder / "mobile") for name in MOBILE_FILES]
    total = hashlib.sha256()
    for path in sorted(files, key=lambda path: path.name):
        if path.is_file():
            content = hashlib.sha256(path.read_bytes()).hexdigest()
            total.update(f"{path.name} {content}\n".encode())
    return total.hexdigest()
