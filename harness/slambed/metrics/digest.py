# SPDX-License-Identifier: Apache-2.0
"""One number for everything that a run measured."""

import hashlib
from pathlib import Path

MOBILE_FILES = ("trajectory.txt", "trajectory_live.txt", "map.slm")
"""What the mobile node leaves beside its events."""


def digest(folder: Path) -> str:
    """SHA-256 over names and bytes of what a run measured, in its raw folder or its result.

    Summary, tables and trajectories; circumstances (manifest, logs) are left out, so equal virtual
    runs have equal digests.
    """
    files = [folder / "summary.json", *folder.glob("*.parquet")]
    files += [place / name for place in (folder, folder / "mobile") for name in MOBILE_FILES]
    total = hashlib.sha256()
    for path in sorted(files, key=lambda path: path.name):
        if path.is_file():
            content = hashlib.sha256(path.read_bytes()).hexdigest()
            total.update(f"{path.name} {content}\n".encode())
    return total.hexdigest()
