# SPDX-License-Identifier: Apache-2.0
"""Where data is looked for and where prepared sequences are kept."""

from __future__ import annotations

import os
from pathlib import Path

from slambed.errors import SlambedError, environment_error
from slambed.native import repository_root


def search_path() -> list[Path]:
    """Folders searched for source data: $SLAMBED_DATA (colon list), ./data, shared data, cache.

    With SLAMBED_DATA_BESIDE=no nothing beside the checkout is looked at: tests set it.
    """
    configured = [Path(p).expanduser() for p in os.environ.get("SLAMBED_DATA", "").split(":") if p]
    root = repository_root()
    beside = [] if os.environ.get("SLAMBED_DATA_BESIDE") == "no" else [root.parent / "shared/data"]
    candidates = [
        *configured,
        Path.cwd() / "data",
        root / "data",
        *beside,
        download_folder(),
    ]
    return list(dict.fromkeys(Path(os.path.normpath(p)) for p in candidates))


def is_open(folder: Path) -> bool:
    """True for a folder that is there and that we may look into."""
    return os.access(folder, os.R_OK | os.X_OK)


def state_of(folder: Path) -> str:
    """Empty for a folder that is searched, else why it is not."""
    if is_open(folder):
        return ""
    try:
        return "may not be read" if folder.exists() else "does not exist"
    except OSError as refused:  # a folder above it is closed
        return refused.strerror.lower() if refused.strerror else "may not be read"


def no_cache(folder: Path, refused: OSError) -> SlambedError:
    """A cache that another user owns, or whose disk is read-only: said the same way everywhere."""
    return environment_error(
        f"{folder}: {refused.strerror}; set SLAMBED_CACHE to a folder you may read and write"
    )


def cache_folder() -> Path:
    """$SLAMBED_CACHE, else $XDG_CACHE_HOME/slambed, else ~/.cache/slambed."""
    if configured := os.environ.get("SLAMBED_CACHE"):
        return Path(configured).expanduser()
    base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(base).expanduser() / "slambed"


def download_folder() -> Path:
    """Where `slambed data download` unpacks to."""
    return cache_folder() / "data"


def prepared_folder(cache_dir: Path | None = None) -> Path:
    """Where prepared sequences are kept."""
    return (cache_dir or cache_folder()) / "prepared"
