# SPDX-License-Identifier: Apache-2.0
"""catalog/inputs/*.yaml: input files of runs that are produced by other runs
(docs/reference/input.md)."""

from typing import Literal

from pydantic import BaseModel, Field

from slambed.files.names import Name, Title
from slambed.spec.experiment import STRICT, Playback
from slambed.spec.system import Scalar

YIELDED = {"map": "map.slm", "live_path": "trajectory_live.txt"}
"""What a recipe can keep of its run -> file name in the run's folder."""


class Conditions(BaseModel):
    """Conditions on the run; if one fails, no file is kept."""

    model_config = STRICT

    coverage: float = Field(default=0.0, ge=0, le=1)
    """Minimum share of the offered frames that have a pose."""
    loops_closed: int = Field(default=0, ge=0)
    """Minimum number of closed loops."""
    global_bundles: int = Field(default=0, ge=0)
    """Minimum number of global bundle adjustments."""

    def broken_by(self, found: dict[str, float]) -> list[str]:
        """Describes each condition that does not hold in one line."""
        return [
            f"{name} is {found[name]:g}, not at least {wanted:g}"
            for name, wanted in self.model_dump().items()
            if found[name] < wanted
        ]


class InputRecipe(BaseModel):
    """One prepared input: the virtual run that produces it, and the file that is kept."""

    model_config = STRICT

    id: Name
    """Name of the input, as of the file."""
    title: Title
    """One line for lists."""
    system: str
    """System whose run makes it."""
    variant: str | None = None
    """Variant of the system; null: the first one."""
    params: dict[str, Scalar] = Field(default_factory=dict)
    """Parameter -> value, instead of the variant's."""
    dataset: str
    """Sequence that is played."""
    playback: Playback = Field(default_factory=lambda: Playback(mode="every_frame"))
    """How its frames are offered."""
    device: str = "host"
    """Device of the mobile node."""
    seed: int = Field(default=1, ge=0, lt=2**31)
    """Seed of the run."""
    yields: Literal["map", "live_path"]
    """What of the run is kept: its map, or the live path."""
    must: Conditions = Field(default_factory=Conditions)
    """What must hold of the run."""
