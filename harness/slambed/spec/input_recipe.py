# SPDX-License-Identifier: Apache-2.0
"""catalog/inputs/*.yaml: files that runs need and that other runs make:
docs/reference/input.md."""

from typing import Literal

from pydantic import BaseModel, Field

from slambed.spec.experiment import NAME, STRICT, Playback
from slambed.spec.system import Scalar

YIELDED = {"map": "map.slm", "live_path": "trajectory_live.txt"}
"""What a recipe can keep of its run, by the file's name there."""


class Conditions(BaseModel):
    """What must hold of a run, else nothing is kept of it."""

    model_config = STRICT

    coverage: float = Field(default=0.0, ge=0, le=1)
    """At least this share of the offered frames has a pose."""
    loops_closed: int = Field(default=0, ge=0)
    """At least so many."""
    global_bundles: int = Field(default=0, ge=0)
    """At least so often the whole map was adjusted."""

    def broken_by(self, found: dict[str, float]) -> list[str]:
        """What does not hold, a line each."""
        return [
            f"{name} is {found[name]:g}, not at least {wanted:g}"
            for name, wanted in self.model_dump().items()
            if found[name] < wanted
        ]


class InputRecipe(BaseModel):
    """One prepared input: which virtual run makes it, and what of it is kept."""

    model_config = STRICT

    id: str = Field(pattern=NAME)
    title: str
    system: str
    variant: str | None = None
    params: dict[str, Scalar] = Field(default_factory=dict)
    dataset: str
    playback: Playback = Field(default_factory=lambda: Playback(mode="every_frame"))
    device: str = "host"
    seed: int = Field(default=1, ge=0, lt=2**31)
    yields: Literal["map", "live_path"]
    must: Conditions = Field(default_factory=Conditions)
