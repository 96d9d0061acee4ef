# SPDX-License-Identifier: Apache-2.0
"""Input files that parameters of type `path` name: found once, known by their content."""

import hashlib
import shutil
from collections.abc import Mapping
from pathlib import Path

from slambed.data.places import search_path
from slambed.errors import SlambedError
from slambed.files.outputs import at_home, is_file
from slambed.native import repository_root

FROM_DATASET = "dataset"
"""Value of a path parameter: the prior map that the dataset's file names (docs/inputs.md)."""
FOLDER = "inputs"
"""In a run's output folder, where every engine's nodes can read."""


def find_input(name: str, near: Path) -> Path:
    """An absolute path, or one beside the experiment, in the checkout or in a data folder."""
    path = at_home(name)
    folders = [near, repository_root(), *search_path()]
    candidates = [path] if path.is_absolute() else [folder / path for folder in folders]
    for candidate in candidates:
        if is_file(candidate):
            return candidate.resolve()
    places = ", ".join(str(candidate.parent) for candidate in candidates)
    raise SlambedError(f"file '{name}' not found, looked in {places}; correct the path")


def sha256_of(path: Path) -> str:
    """Hex digest of the file's content."""
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    except OSError as error:
        raise SlambedError(f"cannot read {path}: {error.strerror}; check its rights") from None
    return digest.hexdigest()


def inside(output: str, parameter: str) -> str:
    """Where the nodes find the file of a parameter."""
    return f"{output}/{FOLDER}/{parameter}"


def copy_inputs(run_dir: Path, files: Mapping[str, str], wanted: Mapping[str, str]) -> None:
    """Copies the files (parameter -> path) into a run's folder; each must still be the one that
    the run was planned with (parameter -> digest)."""
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
