# SPDX-License-Identifier: Apache-2.0
"""Records which prepared sequences were recently verified against their checksums.

Reading a gigabyte would add a second or two to every campaign's start.
"""

import hashlib
import time
from contextlib import suppress
from pathlib import Path

from slambed.data.places import cache_folder
from slambed.data.prepared import FRAMES_FILE, PreparedSequence

FOLDER = "verified"
AGAIN_S = 24 * 3600.0
"""Disks may lose data without a visible change, so files are verified again after this time."""


def verify_once(sequence: PreparedSequence) -> None:
    """Verifies the CRC of every frame, unless that was done recently and the file is unchanged.

    Raises SlambedError for damaged content.
    """
    mark = cache_folder() / FOLDER / _content(sequence)
    if _is_fresh(mark):
        sequence.verify(full=False)
        return
    sequence.verify(full=True)
    with suppress(OSError):  # on failure the next campaign verifies again
        mark.parent.mkdir(parents=True, exist_ok=True)
        for old in mark.parent.iterdir():
            if not _is_fresh(old):
                old.unlink(missing_ok=True)
        mark.touch()


def _content(sequence: PreparedSequence) -> str:
    """Returns a hash that changes if the frames file is modified or replaced."""
    frames = (sequence.path / FRAMES_FILE).resolve()
    now = frames.stat()
    facts = (frames, sequence.checksum, now.st_dev, now.st_ino, now.st_size, now.st_mtime_ns)
    return hashlib.sha256(repr((*facts, now.st_ctime_ns)).encode()).hexdigest()


def _is_fresh(mark: Path) -> bool:
    try:
        return 0 <= time.time() - mark.stat().st_mtime < AGAIN_S
    except OSError:
        return False
