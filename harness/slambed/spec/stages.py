# SPDX-License-Identifier: Apache-2.0
"""`stages:` of a system.yaml: work of a system's own, and the stage whose cost it has."""

from collections.abc import Mapping
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from slambed.spec.device import StageCost
from slambed.suggestion import suggestion


class OwnStage(BaseModel):
    """A stage that no device has to know: it costs what another one costs, times a factor."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    doc: str
    """What is done in the stage."""
    cost_as: str
    """A stage of the devices, or another one of the system's."""
    factor: float = Field(default=1.0, gt=0, le=1e6)
    """Of the fixed part and of the prices of n1 and n2; jitter and accelerator are inherited as
    they are."""
    role: Literal["mobile", "edge"] | None = None
    """The only node that does this work; both if not given."""


def check_stages(stages: Mapping[str, OwnStage]) -> None:
    """ValueError where stages inherit from each other in a circle."""
    for name in stages:
        line = [name]
        while (base := stages[line[-1]].cost_as) in stages:
            if base in line:
                raise ValueError(f"stages inherit in a circle: {' -> '.join([*line, base])}")
            line.append(base)


def costs_with(
    stages: Mapping[str, OwnStage], costs: Mapping[str, StageCost], role: str
) -> dict[str, StageCost]:
    """The costs of a device and those that a system's own stages inherit from them. A stage that
    the device has a cost for keeps it: what was fitted goes before what stands in for it.

    ValueError where a stage inherits from one that the device has no cost for.
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
