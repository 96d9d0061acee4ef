# SPDX-License-Identifier: Apache-2.0
"""`stages:` of a system.yaml: a system's own stages and the stages whose cost they inherit."""

from collections.abc import Mapping
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from slambed.spec.device import StageCost
from slambed.suggestion import suggestion


class OwnStage(BaseModel):
    """A stage that device files need not list: it costs as much as another stage, times a
    factor."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    doc: str
    """What is done in the stage."""
    cost_as: str
    """A stage of the device files, or another stage of this system."""
    factor: float = Field(default=1.0, gt=0, le=1e6)
    """Scales a, b and c of the cost; jitter and accelerator are inherited unchanged."""
    role: Literal["mobile", "edge"] | None = None
    """The only node that executes this stage; both if not given."""


def check_stages(stages: Mapping[str, OwnStage]) -> None:
    """Raises ValueError if stages inherit from each other in a cycle."""
    for name in stages:
        line = [name]
        while (base := stages[line[-1]].cost_as) in stages:
            if base in line:
                raise ValueError(f"stages inherit in a circle: {' -> '.join([*line, base])}")
            line.append(base)


def costs_with(
    stages: Mapping[str, OwnStage], costs: Mapping[str, StageCost], role: str
) -> dict[str, StageCost]:
    """Returns the costs of a device plus those that a system's own stages inherit. A cost fitted
    for the device takes precedence over an inherited one.

    Raises ValueError if a stage inherits from one that the device has no cost for.
    """
    found = dict(costs)

    def cost_of(name: str) -> StageCost:
        if name in found:
            return found[name]
        base, factor = stages[name].cost_as, stages[name].factor
        if base not in found and base not in stages:
            raise ValueError(
                f"stage {name} costs as '{base}', for which it has no cost; "
                + suggestion(base, found)
            )
        cost = cost_of(base)
        prices = {key: getattr(cost, key) * factor for key in ("a_us", "b_us", "c_us")}
        found[name] = cost.model_copy(update=prices)
        return found[name]

    for name, stage in stages.items():
        if stage.role in (None, role):
            cost_of(name)
    return found
