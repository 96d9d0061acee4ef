# SPDX-License-Identifier: Apache-2.0
"""catalog/devices/fits/*.yaml: the times that a paper prints for devices, and their stages."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from slambed.files.names import Title
from slambed.spec.experiment import LinkChoice, Playback, SystemChoice
from slambed.spec.system import Role

STRICT = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class FittedDevice(BaseModel):
    """A device whose cost model is fitted, starting from another device."""

    model_config = STRICT

    device: str
    """Name of the file in catalog/devices/ that the fit writes."""
    like: str = "host"
    """Base device whose costs are scaled; their dependence on sizes is kept."""
    cores: int = Field(default=1, ge=1)
    """Cores of its cost model."""
    factor: float = Field(default=1.0, gt=0)
    """Scale of stages without a component, and initial scale of the others."""
    kept: list[str] = Field(default_factory=list)
    """Stages whose cost in the device file has another source: neither scaled nor overwritten."""
    also: list[str] = Field(default_factory=list)
    """Further device files that get the same stages, with their own cores and speed: other
    machines of the paper without printed times."""
    threads: dict[str, Annotated[int, Field(ge=1)]] = Field(default_factory=dict)
    """Stages that the original runs in several threads at once, and how many. Devices of `also`
    with as many cores take that fraction of the fitted time, which is of one core."""
    given: bool = False
    """True for a device that the runs use unchanged; it is neither fitted nor written."""


class Component(BaseModel):
    """A printed time, and the stages that are scaled until runs reproduce it."""

    model_config = STRICT

    name: str
    """What reports of the fit call it."""
    source: str
    """Where it is printed, and how we read it."""
    node: Role
    """Whose device the stages belong to."""
    stages: list[str]
    """Stages that are scaled; if empty, the time follows from the others and is only shown."""
    measure: str = "per_frame"
    """What the time is of. Either a part of T_Total, such as `T_LM`. Or the time of the stages on
    `node`, in a tracked frame (`per_frame`), or in a frame that becomes a keyframe
    (`per_keyframe`). `per_mapped_keyframe` counts for each keyframe that was mapped. `per_update`
    is for an applied map update that no lost frame requested. `per_attempt` is each execution of
    the stages that reached a pose. `per_answer` is from capture until the edge's pose of the frame
    arrives."""
    along: list[str] = Field(default_factory=list)
    """Stages without a printed time that are scaled like `stages`."""
    fixed_on: str | None = None
    """Stage whose size-independent time is fitted instead of scaled, if one factor cannot fit all
    conditions."""
    fixed_at_most: float = Field(default=1.0, gt=0, le=1)
    """Largest fraction of the mean that may be independent of sizes."""
    mean_ms: dict[str, float]
    """Maps a condition to the printed mean."""
    sd_ms: dict[str, float] = Field(default_factory=dict)
    """Maps a condition to the printed standard deviation, which sets the jitter of the stages."""

    @model_validator(mode="after")
    def _fixed_is_one_of_them(self) -> "Component":
        if self.fixed_on is not None and self.fixed_on not in self.stages:
            raise ValueError(f"fixed_on {self.fixed_on} is not among the stages")
        return self


class Targets(BaseModel):
    """One fit: conditions to simulate, devices to fit, component times to reproduce."""

    model_config = STRICT

    title: Title
    """One line for the fit's report."""
    dataset: str
    """Sequence that is played."""
    datasets: dict[str, str] = Field(default_factory=dict)
    """Maps a condition to its sequence, if it is not `dataset`."""
    playback: Playback
    """How its frames are offered."""
    link: LinkChoice | None = None
    """Link of the simulated runs; none for a system without an edge."""
    conditions: dict[str, SystemChoice] = Field(min_length=1)
    """Condition of the paper -> the system and parameters that are run for it."""
    devices: dict[Role, FittedDevice]
    """Role -> the device to fit."""
    components: list[Component] = Field(min_length=1)
    """The printed times to meet."""
    fits: list[str] = Field(default_factory=list)
    """Ids of the published cells (`*` allowed) that the devices are fitted to, including sums of
    fitted ones. Agreement with these is no evidence (docs/explanation/verdicts.md)."""
    runs: int = Field(default=2, ge=1)
    """Runs of each condition in a round."""
    rounds: int = Field(default=6, ge=1)
    """Rounds of running and scaling, at most."""
    damping: float = Field(default=0.0, ge=0, lt=1)
    """Fraction of each step that is not taken, if costs change the events: slower tracking creates
    other keyframes, and these other updates."""
    notes: str = ""
    """What a reader must know."""

    @model_validator(mode="after")
    def _names_agree(self) -> "Targets":
        if strangers := set(self.datasets) - set(self.conditions):
            raise ValueError(f"datasets: no condition {min(strangers)}")
        for component in self.components:
            unknown = {*component.mean_ms, *component.sd_ms} - set(self.conditions)
            if unknown:
                raise ValueError(f"component {component.name}: no condition {min(unknown)}")
            if component.fixed_on is not None and len(component.mean_ms) < 2:
                raise ValueError(
                    f"component {component.name}: fixed_on needs two printed means, one leaves "
                    "open what is fixed"
                )
            if component.node not in self.devices:
                raise ValueError(f"component {component.name}: no device for {component.node}")
            if self.devices[component.node].given:
                raise ValueError(f"component {component.name}: its device is given")
            both = {*component.stages, *component.along} & {*self.devices[component.node].kept}
            if both:
                raise ValueError(f"component {component.name}: stage {min(both)} is to be kept")
        return self

    def dataset_of(self, condition: str) -> str:
        return self.datasets.get(condition, self.dataset)
