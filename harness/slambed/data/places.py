# SPDX-License-Identifier: Apache-2.0
"""Where data is looked for and where prepared sequences are kept."""

from __future__ import annotations

import os
from pathlib import Path

from slambed.native import repository_root


def search_path() -> list[Path]:
    """Folders searched for source data: $SLAMBED_DATA (colon list), ./data, shared data, cache."""
    configured = [Path(p).expanduser() for p in os.environ.get("SLAMBED_DATA", "").split(":") if p]
    root = repository_root()
    candidates = [
        *configured,
        Path.cwd() / "data",
        root / "data",
        root.parent / "shared" / "data",
        download_folder(),
    ]
    return list(dict.fromkeys(Path(os.path.normpath(p)) for p in candidates))


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
