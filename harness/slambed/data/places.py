# SPDX-License-Identifier: Apache-2.0
"""Where data is looked for and where prepared sequences are kept."""

from __future__ import annotations

import os
from pathlib import Path

from slambed.errors import SlambedError, environment_error
from slambed.files.outputs import make_folder
from slambed.native import cache_folder as cache_folder
from slambed.native import is_installed, repository_root

DATASETS_VARIABLE = "SLAMBED_DATASETS"
PICTURES = "pictures"
MADE_AGAIN = {
    "prepared": "sequences, decoded or generated",
    "features": "features and pictures of every frame, for virtual runs",
    "inputs": "prior maps and references",
    "masks": "what networks found in sequences",
    "recorded": "sequences as folders, for systems that read one",
    PICTURES: "pictures that nobody gave a place",
    "verified": "which sequences were read against their checksums",
}
"""Folders of the cache that may be removed at any time, and what they hold."""
OURS = (*MADE_AGAIN, "programs", "data", "networks", "uml", "host_speed.json")
"""All that slambed makes in its cache. Whatever else lies there is somebody's who knows why."""


def search_path() -> list[Path]:
    """Folders searched for source data: $SLAMBED_DATA (colon list), ./data, shared data, cache.

    With SLAMBED_DATA_BESIDE=no nothing beside the checkout is looked at: tests set it.
    """
    configured = [Path(p).expanduser() for p in os.environ.get("SLAMBED_DATA", "").split(":") if p]
    root = repository_root()
    own = [] if is_installed() else [root / "data"]
    if own and os.environ.get("SLAMBED_DATA_BESIDE") != "no":
        own.append(root.parent / "shared/data")
    candidates = [
        *configured,
        Path.cwd() / "data",
        *own,
        download_folder(),
    ]
    return list(dict.fromkeys(Path(os.path.normpath(p)) for p in candidates))


def dataset_folders() -> list[Path]:
    """Folders of dataset files of one's own: $SLAMBED_DATASETS (colon list)."""
    folders = os.environ.get(DATASETS_VARIABLE, "").split(os.pathsep)
    return [Path(part).expanduser().resolve() for part in folders if part]


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


def download_folder() -> Path:
    """Where `slambed data download` unpacks to."""
    return cache_folder() / "data"


def picture(name: str) -> Path:
    """The place of a picture without an --output: in the cache, because where somebody works is no
    place for what he did not ask for."""
    folder = cache_folder() / PICTURES
    make_folder(folder, "--output")
    return folder / name


def prepared_folder(cache_dir: Path | None = None) -> Path:
    """Where prepared sequences are kept."""
    return (cache_dir or cache_folder()) / "prepared"
