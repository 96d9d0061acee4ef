# SPDX-License-Identifier: Apache-2.0
"""Where matplotlib and fontconfig keep what they know of fonts, when the caller's home cannot be
written to: each of them would warn of that in every command."""

import atexit
import logging
import os
import shutil
import tempfile
from pathlib import Path

from slambed.native import cache_folder


def settle_font_caches() -> None:
    """Before matplotlib is imported. Without a home that can be written to they have a folder as
    long as this process lives; slambed's own cache stays where it was."""
    # That fonts will be looked for again the next time is no matter of the caller's.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    base = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()
    if _can_be_made(base):
        return
    os.environ["SLAMBED_CACHE"] = str(cache_folder())
    place = tempfile.mkdtemp(prefix="slambed-fonts-")
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    os.environ["XDG_CACHE_HOME"] = place
    os.environ.setdefault("MPLCONFIGDIR", place)


def _can_be_made(folder: Path) -> bool:
    try:
        there = next(place for place in (folder, *folder.parents) if place.exists())
    except OSError:
        return False  # it may not even be looked into
    return os.access(there, os.W_OK | os.X_OK)
