# SPDX-License-Identifier: Apache-2.0
"""catalog/devices/fits/*.yaml: what a paper prints about devices, and which stages stand for it."""

from pydantic import BaseModel, ConfigDict, Field, model_validator

from slambed.spec.experiment import LinkChoice, Playback, SystemChoice
from slambed.spec.system import Role

STRICT = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class FittedDevice(BaseModel):
    """A device whose cost model is to be found, starting from another one."""

    model_config = STRICT

    device: str
    """Name of the file in catalog/devices/ that the fit writes."""
    like: str = "host"
    """Its costs are scaled; their dependence on sizes is kept."""
    cores: int = Field(default=1, ge=1)
    """Cores of its cost model."""
    factor: float = Field(default=1.0, gt=0)
    """For stages that no component is about, and to start with."""
    kept: list[str] = Field(default_factory=list)
    """Stages whose cost the device file has from elsewhere: neither scaled nor overwritten."""
    given: bool = False
    """The runs need it as its file has it; the fit is not about it and writes nothing."""


class Component(BaseModel):
    """A printed time, and the stages that are scaled until a run shows it."""

    model_config = STRICT

    name: str
    """What reports of the fit call it."""
    source: str
    """Where it is printed, and how we read it."""
    node: Role
    """Whose device the stages belong to."""
    stages: list[str]
    """None: the time follows from the others and is only shown."""
    measure: str = "per_frame"
    """A part of T_Total (`T_LM`, ...), or the stages' time on the mobile node in a tracked frame
    (`per_frame`), in one that becomes a keyframe (`per_keyframe`) or in a map update that was taken
    over and not sent for a lost frame (`per_update`); or the time of each of the stages' executions
    that got as far as a pose, on either node (`per_attempt`); or that from capturing a frame until
    the edge's pose of it is there (`per_answer`)."""
    along: list[str] = Field(default_factory=list)
    """Stages that are scaled as these are, and that no printed time is about."""
    fixed_on: str | None = None
    """Stage whose time independent of sizes is found instead of scaled, where one factor cannot
    serve all conditions."""
    fixed_at_most: float = Field(default=1.0, gt=0, le=1)
    """Largest share of the mean that may be independent of sizes."""
    mean_ms: dict[str, float]
    """Condition -> printed mean."""
    sd_ms: dict[str, float] = Field(default_factory=dict)
    """Condition -> printed standard deviation; sets the jitter of the stages."""

    @model_validator(mode="after")
    def _fixed_is_one_of_them(self) -> "Component":
        if self.fixed_on is not None and self.fixed_on not in self.stages:
            raise ValueError(f"fixed_on {self.fixed_on} is not among the stages")
        return self


class Targets(BaseModel):
    """One fit: conditions to simulate, devices to find, components to meet."""

    model_config = STRICT

    title: str
    """One line for the fit's report."""
    dataset: str
    """Sequence that is played."""
    datasets: dict[str, str] = Field(default_factory=dict)
    """Condition -> sequence, where it is not `dataset`."""
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
    """Ids of the published cells (`*` allowed) that the devices are fitted to, sums of fitted ones
    among them: where our runs agree with these, that is no evidence (docs/results.md)."""
    runs: int = Field(default=2, ge=1)
    """Runs of each condition in a round."""
    rounds: int = Field(default=6, ge=1)
    """Rounds of running and scaling, at most."""
    damping: float = Field(default=0.0, ge=0, lt=1)
    """Share of each step that is not taken, where costs change what happens: who tracks slowly
    makes other keyframes, and these other updates."""
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
        """The sequence that this condition is played on."""
        return self.datasets.get(condition, self.dataset)
