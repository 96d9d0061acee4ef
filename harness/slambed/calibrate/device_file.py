# SPDX-License-Identifier: Apache-2.0
"""Writes a cost model into a device file and leaves everything else unchanged."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.error import YAMLError

from slambed.errors import SlambedError, environment_error
from slambed.files.atomic import replacing
from slambed.spec.device import CostModel, StageCost

MODEL = "model"
WIDTH = 100_000
"""Line width that never wraps, so that existing line breaks stay."""


def write_model(path: Path, model: CostModel, comments: Mapping[str, str], title: str) -> None:
    """Replaces the model of a device file, or creates a file with this model.

    A stage's comment follows its line; the comment of '' precedes the model. Stages that the new
    model does not name (loop closing is rare) keep their cost and comments.
    """
    fresh = f"# SPDX-License-Identifier: Apache-2.0\nname: {path.stem}\nlimits: {{}}\n"
    yaml = _round_trip()
    try:
        device = yaml.load(_without_head(path.read_text("utf-8")) if path.is_file() else fresh)
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        raise SlambedError(f"cannot read {path}: {' '.join(str(error).split())}") from None
    if not isinstance(device, CommentedMap):
        raise SlambedError(f"{path} is no device; choose another --output")
    if "title" not in device:
        device.insert(1, "title", title)
    block = device.setdefault(MODEL, CommentedMap())
    block["cores"], block["speed"] = model.cores, _number(model.speed)
    if model.accelerators:
        accelerators = block.setdefault("accelerators", CommentedMap())
        for name, found in sorted(model.accelerators.items()):
            accelerators[name] = _in_line({"lanes": found.lanes, "speed": _number(found.speed)})
    stages = block.setdefault("stages", CommentedMap())
    for name, cost in sorted(model.stages.items()):
        if name not in stages:
            stages.insert(sum(other < name for other in stages), name, None)
        stages[name] = _in_line(_cost(cost))
        _note(stages, name, comments.get(name, ""))
    if comments.get(""):
        device.yaml_set_comment_before_after_key(MODEL, before=comments[""])
    written = io.StringIO()
    yaml.dump(device, written)
    try:
        with replacing(path) as whole:
            whole.write_text(written.getvalue(), encoding="utf-8")
    except OSError as error:
        raise environment_error(f"cannot write {path}: {error.strerror}") from None


def _round_trip() -> YAML:
    yaml = YAML()
    yaml.width = WIDTH
    yaml.preserve_quotes = True
    return yaml


def _cost(cost: StageCost) -> dict[str, Any]:
    """Returns a_us, and all values that are not 0 or empty."""
    return {
        key: value if isinstance(value, str) else _number(value)
        for key, value in cost.model_dump().items()
        if value or key == "a_us"
    }


def _number(value: float) -> int | float:
    """Rounds to six digits, because fits are no better; integers have no decimal point."""
    short = float(f"{value:g}")
    return int(short) if short.is_integer() else short


def _in_line(content: dict[str, Any]) -> CommentedMap:
    found = CommentedMap(content)
    found.fa.set_flow_style()
    return found


def _note(stages: CommentedMap, name: str, comment: str) -> None:
    """Replaces the comment in the line of a stage. Comment lines below it, which the tree stores in
    the same comment, stay."""
    old = stages.ca.items.pop(name, None)
    below = old[2].value.partition("\n")[2] if old and old[2] else ""
    if comment or below:
        stages.yaml_add_eol_comment(comment or "-", name, column=0)
        stages.ca.items[name][2].value = (f"# {comment}" if comment else "") + f"\n{below}"


def _without_head(text: str) -> str:
    """Removes the comment before the model, which names the old one's origin; a YAML tree would
    attach it to the preceding key."""
    kept: list[str] = []
    for line in text.splitlines():
        if line.startswith(f"{MODEL}:"):
            while kept and kept[-1].startswith("#") and "SPDX" not in kept[-1]:
                kept.pop()
        kept.append(line)
    return "".join(f"{line}\n" for line in kept)
