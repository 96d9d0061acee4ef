# SPDX-License-Identifier: Apache-2.0
"""Writes a cost model into a device file and leaves everything else in it as it is."""

from collections.abc import Mapping
from pathlib import Path

from slambed.errors import environment_error
from slambed.spec.device import CostModel, StageCost
from slambed.yaml_text import read_yaml

MODEL = "model:"


def model_lines(model: CostModel, comments: Mapping[str, str]) -> list[str]:
    """The `model` block; a stage's comment follows its line, that of '' heads the block."""
    lines = [f"# {line}" for line in comments.get("", "").splitlines()]
    lines += [MODEL, f"  cores: {model.cores}", f"  speed: {model.speed:g}"]
    if model.accelerators:
        lines.append("  accelerators:")
        for name, found in sorted(model.accelerators.items()):
            lines.append(f"    {name}: {{lanes: {found.lanes}, speed: {found.speed:g}}}")
    lines.append("  stages:")
    width = max((len(name) for name in model.stages), default=0)
    for name, cost in sorted(model.stages.items()):
        comment = f"  # {comments[name]}" if name in comments else ""
        lines.append(f"    {name + ':':{width + 1}} {_flow(cost)}{comment}")
    return lines


def _flow(cost: StageCost) -> str:
    inside = ", ".join(
        f"{key}: {value}" if isinstance(value, str) else f"{key}: {value:g}"
        for key, value in cost.model_dump().items()
        if value or key == "a_us"
    )
    return f"{{{inside}}}"


def write_model(path: Path, model: CostModel, comments: Mapping[str, str], title: str) -> None:
    """Replaces the model of a device file, or makes a new file with this model.

    Stages that the new model does not name (closing a loop is rare) keep the cost they had.
    """
    if path.is_file():
        text = path.read_text(encoding="utf-8")
        kept = without_model(text.splitlines())
        model = model.model_copy(update={"stages": stages_in(text) | model.stages})
    else:
        head = ["# SPDX-License-Identifier: Apache-2.0", f"name: {path.stem}"]
        kept = [*head, f"title: {title}", "limits: {}"]
    try:
        path.write_text("\n".join([*kept, *model_lines(model, comments)]) + "\n", encoding="utf-8")
    except OSError as error:
        raise environment_error(f"cannot write {path}: {error.strerror}") from None


def stages_in(text: str) -> dict[str, StageCost]:
    """Costs of the stages in a device file; none when it has no model."""
    device = read_yaml(text)
    model = device.get("model") if isinstance(device, dict) else None
    return dict(CostModel.model_validate(model).stages) if model else {}


def without_model(lines: list[str]) -> list[str]:
    """The lines outside the `model` block and the comment lines directly before it."""
    kept: list[str] = []
    inside = False
    for line in lines:
        if line.startswith(MODEL):
            inside = True
            while kept and kept[-1].startswith("#") and "SPDX" not in kept[-1]:
                kept.pop()
        elif inside and line[:1].strip() and not line.startswith("#"):
            inside = False
        if not inside:
            kept.append(line)
    return kept
