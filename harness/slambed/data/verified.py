# SPDX-License-Identifier: Apache-2.0
"""Prepared sequences whose every frame was read against its checksum a short while ago.

To read a gigabyte takes a second or two of every campaign's start.
"""

import hashlib
import time
from contextlib import suppress
from pathlib import Path

from slambed.data.places import cache_folder
from slambed.data.prepared import FRAMES_FILE, PreparedSequence

FOLDER = "verified"
AGAIN_S = 24 * 3600.0
"""Disks forget without a file looking changed: after so long all is read again."""


def verify_once(sequence: PreparedSequence) -> None:
    """Reads every frame against its CRC, unless that was done and the file is what it was then.

    Raises SlambedError when the content is damaged.
    """
    mark = cache_folder() / FOLDER / _content(sequence)
    if _is_fresh(mark):
        sequence.verify(full=False)
        return
    sequence.verify(full=True)
    with suppress(OSError):  # then the next campaign reads it again
        mark.parent.mkdir(parents=True, exist_ok=True)
        for old in mark.parent.iterdir():
            if not _is_fresh(old):
                old.unlink(missing_ok=True)
        mark.touch()


def _content(sequence: PreparedSequence) -> str:
    """Changes with whatever is written to the frames, or in their place."""
    frames = (sequence.path / FRAMES_FILE).resolve()
    now = frames.stat()
    facts = (frames, sequence.checksum, now.st_dev, now.st_ino, now.st_size, now.st_mtime_ns)
    return hashlib.sha256(repr((*facts, now.st_ctime_ns)).encode()).hexdigest()


def _is_fresh(mark: Path) -> bool:
    try:
        return 0 <= time.time() - mark.stat().st_mtime < AGAIN_S
    except OSError:
        return False
