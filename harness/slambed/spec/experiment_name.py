# SPDX-License-Identifier: Apache-2.0
"""What somebody named on the command line for an experiment."""

from pathlib import Path

from slambed.errors import SlambedError

YAML = (".yaml", ".yml")


def must_be_an_experiment(given: str, known: list[str]) -> None:
    """A name or a YAML file; what is neither, but is there, is reported for what it is."""
    path = Path(given)
    if given in known or path.suffix in YAML:
        return
    what = "an experiment is a name in experiments/ or a file that ends in .yaml or .yml"
    if path.is_dir():
        raise SlambedError(f"{given} is a folder; {what}")
    if path.is_file() or path.suffix.lower() in YAML:
        raise SlambedError(f"{given} does not end in .yaml or .yml; {what}")
