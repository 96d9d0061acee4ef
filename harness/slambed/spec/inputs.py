# SPDX-License-Identifier: Apache-2.0
"""Input files named by parameters of type `path`: located once and identified by content."""

import hashlib
import shutil
from collections.abc import Mapping
from pathlib import Path

from slambed.data.places import search_path
from slambed.errors import SlambedError
from slambed.files.outputs import at_home, is_file
from slambed.native import repository_root

FROM_DATASET = "dataset"
"""Value of a path parameter that selects the prior map named in the dataset's file
(docs/reference/input.md)."""
FOLDER = "inputs"
"""Subfolder of a run's output folder, which nodes of every engine can read."""


def find_input(name: str, near: Path) -> Path:
    """Resolves an absolute path, or one relative to the experiment, the checkout or a data
    folder."""
    path = at_home(name)
    folders = [near, repository_root(), *search_path()]
    candidates = [path] if path.is_absolute() else [folder / path for folder in folders]
    for candidate in candidates:
        if is_file(candidate):
            return candidate.resolve()
    places = ", ".join(str(candidate.parent) for candidate in candidates)
    raise SlambedError(f"file '{name}' not found, looked in {places}; correct the path")


def sha256_of(path: Path) -> str:
    """Returns the hex digest of the file's content."""
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    except OSError as error:
        raise SlambedError(f"cannot read {path}: {error.strerror}; check its rights") from None
    return digest.hexdigest()


def inside(output: str, parameter: str) -> str:
    """Returns the path at which nodes find the file of a parameter."""
    return f"{output}/{FOLDER}/{parameter}"


def copy_inputs(run_dir: Path, files: Mapping[str, str], wanted: Mapping[str, str]) -> None:
    """Copies the files (parameter -> path) into a run's folder. Raises SlambedError if a file no
    longer has the digest it was planned with (`wanted`: parameter -> digest)."""
    for parameter, path in files.items():
        target = Path(inside(str(run_dir), parameter))
        target.parent.mkdir(exist_ok=True)
        try:
            shutil.copyfile(path, target)
        except OSError as error:
            raise SlambedError(f"cannot copy {path}: {error.strerror}; put it back") from None
        if sha256_of(target) != wanted[parameter]:
            raise SlambedError(f"{path} has changed since the campaign began; start it again")
        target.chmod(0o644)
