# SPDX-License-Identifier: Apache-2.0
"""Finds the results folders that the user names."""

from pathlib import Path

from slambed.errors import SlambedError
from slambed.spec.experiment_name import name_of


def experiment_folder(results: Path, experiment: str) -> Path:
    """Returns `results/<name>` for a name or a YAML file, or the given folder itself."""
    given = Path(experiment)
    if (given / "runs").is_dir():
        return given
    folder = results / name_of(experiment)
    if not folder.is_dir():
        raise SlambedError(f"no results in {folder}; start with 'slambed run {experiment}'")
    return folder


def result_folders(results: Path) -> list[Path]:
    """Returns the folders of all experiments, sorted by name."""
    return sorted(path.parent for path in results.glob("*/runs") if path.is_dir())
