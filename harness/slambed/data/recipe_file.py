# SPDX-License-Identifier: Apache-2.0
"""Loading one datasets/*.yaml with errors that name file, line and the likely intention."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ValidationError

from slambed.data.recipe import Dataset
from slambed.data.suggestion import did_you_mean
from slambed.errors import SlambedError
from slambed.yaml_text import read_yaml, with_parser


def load_recipe(path: Path) -> Dataset:
    """Reads and checks one dataset file."""
    try:
        text = path.read_text(encoding="utf-8")
        raw = read_yaml(text)
        lines = _key_lines(with_parser(lambda p: yaml.compose(text, Loader=p)))
    except yaml.YAMLError as broken:
        mark = getattr(broken, "problem_mark", None)
        where = f"{path}:{mark.line + 1}" if mark else str(path)
        problem = getattr(broken, "problem", None) or "cannot be parsed"
        raise SlambedError(f"{where}: not valid YAML: {problem}") from broken
    except (OSError, UnicodeDecodeError) as refused:
        raise SlambedError(f"{path}: cannot be read ({refused})") from refused
    if not isinstance(raw, dict):
        raise SlambedError(f"{path}: expected a mapping with id, title, ...")
    try:
        dataset = Dataset.model_validate(raw)
    except ValidationError as invalid:
        raise _explain(path, invalid, lines) from invalid
    if dataset.id != path.stem:
        raise SlambedError(f"{path}: id is '{dataset.id}'; name the file {dataset.id}.yaml")
    return dataset


def _explain(
    path: Path, invalid: ValidationError, lines: dict[tuple[str, ...], int]
) -> SlambedError:
    # An unknown key explains a missing one beside it: `f_x` for `fx`.
    first = min(invalid.errors(), key=lambda error: error["type"] != "extra_forbidden")
    location = tuple(str(part) for part in first["loc"])
    line = next(
        (lines[location[:n]] for n in range(len(location), 0, -1) if location[:n] in lines), 1
    )
    name = ".".join(location)
    if first["type"] == "extra_forbidden":
        known = _known_keys(location[:-1])
        hint = did_you_mean(location[-1], known) or f"; known: {', '.join(known)}"
        return SlambedError(f"{path}:{line}: unknown key '{name}'{hint}")
    message = first["msg"].removeprefix("Value error, ")
    return SlambedError(f"{path}:{line}: {name + ': ' if name else ''}{message}")


def _known_keys(parents: Sequence[str]) -> list[str]:
    model: type[BaseModel] = Dataset
    for parent in parents:
        annotation = model.model_fields[parent].annotation
        options = getattr(annotation, "__args__", (annotation,))
        model = next(o for o in options if isinstance(o, type) and issubclass(o, BaseModel))
    return list(model.model_fields)


def _key_lines(node: Any, prefix: tuple[str, ...] = ()) -> dict[tuple[str, ...], int]:
    lines: dict[tuple[str, ...], int] = {}
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            name = (*prefix, str(key.value))
            lines[name] = key.start_mark.line + 1
            lines |= _key_lines(value, name)
    return lines
