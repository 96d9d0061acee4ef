# SPDX-License-Identifier: Apache-2.0
"""experiments/*.yaml: what is compared, on what, over which link, how often."""

from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    field_validator,
    model_validator,
)

from slambed.spec.board import Roles
from slambed.spec.device import DeviceChange
from slambed.spec.faults import Fault, check_faults, cuts
from slambed.spec.system import Scalar

STRICT = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
NAME = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"
Pace = Literal["host", "device"]
HOST_PACE: Pace = "host"
DEVICE_PACE: Pace = "device"


class Playback(BaseModel):
    """How frames are offered to tracking."""

    model_config = STRICT

    mode: Literal["realtime", "every_frame"] = "realtime"
    """`realtime`: a frame is offered at its sequence time; one that arrives while tracking is busy
    waits, and a newer one replaces it. `every_frame`: the next one is offered when tracking is
    done, but not before its time."""
    fps: float | None = Field(default=None, gt=0)
    """Below the recorded rate every k-th frame is kept (k = recorded / asked, rounded); null plays
    as recorded."""
    start_s: float = Field(default=0.0, ge=0)
    """Of the sequence."""
    end_s: float | None = Field(default=None, gt=0)
    """Of the sequence; null plays to its end."""
    stop_at_first_loss: bool = False
    """Playback ends with the first track loss: for experiments that only ask whether and when."""

    @model_validator(mode="after")
    def _has_length(self) -> "Playback":
        if self.end_s is not None and self.end_s <= self.start_s:
            raise ValueError(f"end_s {self.end_s} is not after start_s {self.start_s}")
        return self

    def meaning(self) -> dict[str, Any]:
        """Part of a run's key, which what a run does not ask for leaves as it is."""
        content = self.model_dump(mode="json")
        if not self.stop_at_first_loss:
            del content["stop_at_first_loss"]
        return content


class DeviceChoice(BaseModel):
    """Names of catalog/devices/*.yaml, or devices with changes (engine virtual only)."""

    model_config = STRICT

    mobile: str | DeviceChange = "host"
    """Device of the mobile node."""
    edge: str | DeviceChange = "host"
    """Device of the edge."""


class OwnDevices(BaseModel):
    """Devices of one system; a role that is not given has the experiment's."""

    model_config = STRICT

    mobile: str | DeviceChange | None = None
    """Device of the mobile node."""
    edge: str | DeviceChange | None = None
    """Device of the edge."""


Faults = Annotated[list[Fault], AfterValidator(check_faults)]


class SystemChoice(BaseModel):
    """One system of the comparison with its parameters."""

    model_config = STRICT

    system: str
    """Name of a system, or path of its YAML file as seen from the experiment."""
    variant: str | None = None
    """Variant of the system; null: the first one."""
    params: dict[str, Scalar] = Field(default_factory=dict)
    """Parameter -> value, instead of the variant's."""
    label: str | None = Field(default=None, pattern=r"^[^/\n]+$")
    """Name of this row in tables; `system` or `system:variant` when not given."""
    profiles: list[str] | None = None
    """Only these link profiles of the experiment; all when not given."""
    devices: OwnDevices = Field(default_factory=OwnDevices)
    """Instead of the experiment's devices."""
    faults: Faults | None = None
    """Instead of the experiment's faults."""


class LinkChoice(BaseModel):
    """The link between the nodes, and how its latency changes."""

    model_config = STRICT

    backend: Literal["auto", "relay", "netem"] = "auto"
    """What shapes a live link; `auto`: netem where the kernel has it and it can do the profile,
    else the relay."""
    profiles: list[str | float | dict[str, Any]] = Field(min_length=1)
    """Names of netem_profiles/*.yaml, constant RTTs in ms, or profiles written in place."""


class Runs(BaseModel):
    """Repetitions of every cell."""

    model_config = STRICT

    default: int = Field(default=3, ge=1)
    """As many as are made without `--runs`."""
    paper: int | None = Field(default=None, ge=1)
    """As many as the paper made; asked for with `--runs paper`."""


class Tolerances(BaseModel):
    """A run outside these is invalid."""

    model_config = STRICT

    rtt_error_ms_median: float = Field(default=1.0, gt=0)
    """Median of |measured RTT - asked RTT| over the run."""
    rtt_error_ms_p99: float | None = Field(default=None, gt=0)
    """Its 99th percentile; without a value 20 ms over the relay (metrics/validity.py)."""
    host_stall_ms_max: float | None = Field(default=None, gt=0)
    """Longest time for which something else on the host held the mobile node up."""
    cpu_wait_share_max: float | None = Field(default=None, gt=0, le=1)
    """Of the time in which the mobile node's threads wanted a processor: what they waited."""


class Report(BaseModel):
    """What the report should show first; it shows everything anyway."""

    model_config = STRICT

    metrics: list[str] = Field(default_factory=list)
    """Keys of summary.json in the first table."""
    plots: list[str] = Field(default_factory=list)
    """Keys of summary.json that are drawn first."""


class Experiment(BaseModel):
    """One experiment file."""

    model_config = STRICT

    id: str = Field(pattern=NAME)
    """Name of the experiment, as of the file."""
    title: str
    """Heading of the report."""
    reproduces: list[str] = Field(default_factory=list)
    """Ids of papers, tables, figures and claims that the report compares the runs with."""
    systems: list[SystemChoice] = Field(min_length=1)
    """What is compared."""
    datasets: list[str] = Field(min_length=1)
    """Names of datasets, or paths of their YAML files as seen from the experiment."""
    missing_datasets: Literal["refuse", "skip"] = "refuse"
    """Whether a dataset that is not on this machine ends the experiment or is left out of it."""
    playback: Playback = Field(default_factory=Playback)
    """How frames are offered to tracking."""
    faults: Faults = Field(default_factory=list)
    """What goes wrong in every run of a system with an edge."""
    link: LinkChoice | None = None
    """Link between the nodes; null: no system has an edge."""
    devices: DeviceChoice = Field(default_factory=DeviceChoice)
    """What the nodes run on."""
    roles: Roles | None = None
    """Nodes on another machine: a mobile node on a real board, over the real network to the edge
    here (docs/hosts.md)."""
    engine: Literal["auto", "docker", "local", "virtual"] = "auto"
    """What executes the runs; `auto`: Docker where its daemon answers, else `local`."""
    pace: Pace = HOST_PACE
    """Of live runs: what a stage takes is this host's (`host`), or what the device's cost model
    charges (`device`; docs/limits.md). A virtual run is always at the device's pace."""
    runs: Runs = Field(default_factory=Runs)
    """Repetitions of every cell."""
    seed: int = Field(default=1, ge=0, lt=2**31)
    """Repetition k of every cell has the same seed, which follows from this one."""
    tolerances: Tolerances = Field(default_factory=Tolerances)
    """Outside of which a run is invalid."""
    report: Report = Field(default_factory=Report)
    """What the report shows first."""
    notes: str = ""
    """What a reader must know."""

    @field_validator("datasets")
    @classmethod
    def _datasets_differ(cls, value: list[str]) -> list[str]:
        if len(set(value)) != len(value):
            raise ValueError("a dataset is named twice")
        return value


def has_cuts(experiment: Experiment) -> bool:
    """True when the link of any run is cut."""
    return any(cuts(f or []) for f in (experiment.faults, *(c.faults for c in experiment.systems)))


def assumed(experiment: Experiment) -> list[str]:
    """What an experiment leaves to a default that changes what its runs mean."""
    if "mobile" in experiment.devices.model_fields_set or experiment.roles is not None:
        return []
    own = [choice.devices.mobile is not None for choice in experiment.systems]
    if all(own):
        return []
    return ["devices.mobile is not given: the mobile node is this host, without a slower device"]
