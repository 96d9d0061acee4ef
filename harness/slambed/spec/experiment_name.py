# SPDX-License-Identifier: Apache-2.0
"""Checks the argument that names an experiment on the command line."""

from pathlib import Path

from slambed.errors import SlambedError

YAML = (".yaml", ".yml")


def name_of(given: str) -> str:
    """Returns the name of an experiment that is given by its name, which may have a dot, by its
    YAML file, or by a folder of its results."""
    path = Path(given)
    return path.stem if path.suffix in YAML else path.name


def must_be_an_experiment(given: str, known: list[str]) -> None:
    """Accepts a name or a YAML file; the error for any other existing path says what the path
    is."""
    path = Path(given)
    if given in known or path.suffix in YAML:
        return
    what = "an experiment is a name in experiments/ or a file that ends in .yaml or .yml"
    if path.is_dir():
        raise SlambedError(f"{given} is a folder; {what}")
    if path.is_file() or path.suffix.lower() in YAML:
        raise SlambedError(f"{given} does not end in .yaml or .yml; {what}")
