# SPDX-License-Identifier: Apache-2.0
"""Dataset files: finding them, and loading one with errors that name file, line and a likely
fix."""

from pathlib import Path

from slambed.data.recipe import Dataset
from slambed.files.outputs import resolved
from slambed.files.yaml_source import load_yaml, read_model

DATASET_FILE = "dataset.yaml"
"""Its folder is named after the dataset; any other dataset file is named after it itself."""


def dataset_files(folder: Path) -> list[Path]:
    """Lists the dataset files in a user's folder: NAME.yaml and NAME/dataset.yaml."""
    return sorted([*folder.glob("*.yaml"), *folder.glob(f"*/{DATASET_FILE}")])


def dataset_name(path: Path) -> str:
    """Returns the id that a dataset file must have."""
    return resolved(path).parent.name if path.name == DATASET_FILE else path.stem


def load_recipe(path: Path) -> Dataset:
    """Reads and validates one dataset file."""
    dataset = read_model(Dataset, path)
    if dataset.id != dataset_name(path):
        what = "its folder" if path.name == DATASET_FILE else "the file"
        name = dataset.id if path.name == DATASET_FILE else f"{dataset.id}.yaml"
        raise load_yaml(path).complaint(f"the id is '{dataset.id}'", ("id",), f"name {what} {name}")
    return dataset
