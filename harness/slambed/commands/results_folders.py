# SPDX-License-Identifier: Apache-2.0
"""Folders of results that somebody named."""

from pathlib import Path

from slambed.errors import SlambedError


def experiment_folder(results: Path, experiment: str) -> Path:
    """`results/<name>` for a name, a YAML file or the folder itself."""
    given = Path(experiment)
    if (given / "runs").is_dir():
        return given
    folder = results / given.stem
    if not folder.is_dir():
        raise SlambedError(f"no results in {folder}; start with 'slambed run {experiment}'")
    return folder


def result_folders(results: Path) -> list[Path]:
    """Those of all experiments, by name."""
    return sorted(path.parent for path in results.glob("*/runs") if path.is_dir())
