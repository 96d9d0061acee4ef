# SPDX-License-Identifier: Apache-2.0
"""Folders that are searched for data, and folders of prepared sequences."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from slambed.errors import SlambedError, environment_error
from slambed.files.atomic import lock_file
from slambed.files.outputs import at_home, make_folder, resolved
from slambed.native import cache_folder as cache_folder
from slambed.native import is_installed, repository_root

DATASETS_VARIABLE = "SLAMBED_DATASETS"
PICTURES = "pictures"
PYTHON = "python"
MADE_AGAIN = {
    "prepared": "sequences, decoded or generated",
    "features": "features and pictures of every frame, for virtual runs",
    "inputs": "prior maps and references",
    "masks": "what networks found in sequences",
    "recorded": "sequences as folders, for systems that read one",
    PICTURES: "pictures that nobody gave a place",
    "verified": "which sequences were read against their checksums",
    PYTHON: "Python packages of systems",
}
"""Cache folders that may be removed at any time -> their content."""
ONLY_IF_NAMED = frozenset({PYTHON})
"""Of these, what is not asked for by its kind. Packages may be installed in newer versions, and
versions are part of run keys."""
OURS = (*MADE_AGAIN, "programs", "data", "networks", "boards", "uml", "host_speed.json")
"""Everything that slambed creates in its cache; other files there belong to the user."""


def search_path() -> list[Path]:
    """Returns the folders searched for source data: $SLAMBED_DATA (colon list), ./data, shared
    data, cache.

    With SLAMBED_DATA_BESIDE=no the folder next to the checkout is skipped; tests set this.
    """
    configured = [at_home(p) for p in os.environ.get("SLAMBED_DATA", "").split(":") if p]
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
    """Returns the user's folders of dataset files: $SLAMBED_DATASETS (colon list)."""
    folders = os.environ.get(DATASETS_VARIABLE, "").split(os.pathsep)
    return [resolved(at_home(part)) for part in folders if part]


def is_open(folder: Path) -> bool:
    """Returns whether the folder exists and is readable."""
    return os.access(folder, os.R_OK | os.X_OK)


def exists(path: Path) -> bool:
    """Returns whether there is a file or folder that may be looked at."""
    try:
        return path.exists()
    except OSError:
        return False


def state_of(folder: Path) -> str:
    """Returns why a folder cannot be searched; empty if it can."""
    if is_open(folder):
        return ""
    try:
        return "may not be read" if folder.exists() else "does not exist"
    except OSError as refused:  # a parent folder is not accessible
        return refused.strerror.lower() if refused.strerror else "may not be read"


def no_cache(folder: Path, refused: OSError) -> SlambedError:
    """Returns the common error for a cache of another user or on a read-only disk."""
    return environment_error(
        f"{folder}: {refused.strerror}; set SLAMBED_CACHE to a folder you may read and write"
    )


@contextmanager
def making(folder: Path, name: str, what: str, notify: Callable[[str], None]) -> Iterator[None]:
    """Keeps other processes from making `name` in a folder of the cache until the block ends.

    `what` is what the block does, such as "makes a map", for those who wait. Look again in the
    block: another process may have made it. Raises SlambedError where the folder is not ours.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / f".{name}.lock").open("w")
    except OSError as refused:
        raise no_cache(folder, refused) from refused
    with file:
        lock_file(file, what, notify)
        yield


def download_folder() -> Path:
    """Returns the target folder of `slambed data download`."""
    return cache_folder() / "data"


def picture(name: str) -> Path:
    """Returns the default path of a picture without --output: in the cache, to keep unrequested
    files out of the working directory."""
    folder = cache_folder() / PICTURES
    make_folder(folder, "--output")
    return folder / name


def prepared_folder(cache_dir: Path | None = None) -> Path:
    """Returns the folder of prepared sequences."""
    return (cache_dir or cache_folder()) / "prepared"
