# SPDX-License-Identifier: Apache-2.0
"""Loading one datasets/*.yaml with errors that name file, line and the likely intention."""

from pathlib import Path

from slambed.data.recipe import Dataset
from slambed.yaml_source import load_yaml, read_model


def load_recipe(path: Path) -> Dataset:
    """Reads and checks one dataset file."""
    dataset = read_model(Dataset, path)
    if dataset.id != path.stem:
        raise load_yaml(path).complaint(
            f"the id is '{dataset.id}'", ("id",), f"name the file {dataset.id}.yaml"
        )
    return dataset
