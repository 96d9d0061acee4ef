# SPDX-License-Identifier: Apache-2.0
"""What matplotlib takes from the caller's environment: font caches, which are moved when the home
is not writable (otherwise every command would warn), and the backend."""

import atexit
import logging
import os
import shutil
import tempfile
from pathlib import Path

from slambed.native import cache_folder


def settle_font_caches() -> None:
    """Call it before matplotlib is imported. Without a writable home, the font caches get a
    temporary folder for this process; slambed's own cache stays where it was."""
    # The warning that fonts will be searched again next time does not help the user.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    base = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()
    if _can_be_made(base):
        return
    os.environ["SLAMBED_CACHE"] = str(cache_folder())
    place = tempfile.mkdtemp(prefix="slambed-fonts-")
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    os.environ["XDG_CACHE_HOME"] = place
    os.environ.setdefault("MPLCONFIGDIR", place)


def forget_backend() -> None:
    """Removes the drawing backend that the caller's environment names. A cell of a notebook
    passes its own on to every command, and matplotlib without it refuses to be imported. Figures
    are files, for which `report.style` chooses the backend."""
    os.environ.pop("MPLBACKEND", None)


def _can_be_made(folder: Path) -> bool:
    try:
        there = next(place for place in (folder, *folder.parents) if place.exists())
    except OSError:
        return False  # a parent folder denies access
    return os.access(there, os.W_OK | os.X_OK)
