# SPDX-License-Identifier: Apache-2.0
"""experiments/*.yaml: systems, datasets, devices, links and repetitions that are compared."""

from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    field_validator,
    model_validator,
)

from slambed.files.names import Name, Title
from slambed.files.yaml_source import matching
from slambed.spec.board import Roles
from slambed.spec.device import DeviceChange
from slambed.spec.faults import Fault, check_faults, cuts
from slambed.spec.system import Scalar

STRICT = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
Pace = Literal["host", "device"]
HOST_PACE: Pace = "host"
DEVICE_PACE: Pace = "device"


MAX_RUN_MB = 2000


class Playback(BaseModel):
    """How frames are offered to tracking."""

    model_config = STRICT

    mode: Literal["realtime", "every_frame"] = "realtime"
    """`realtime`: a frame is offered at its timestamp; one that arrives while tracking is busy
    waits, and a newer one replaces it. `every_frame`: the next frame is offered when tracking is
    done, but not before its timestamp (without that wait if a system is `sequential`)."""
    fps: float | None = Field(default=None, ge=0.001)
    """At less than the recorded rate every k-th frame is kept (k = recorded rate / `fps`,
    rounded); null plays all frames."""
    start_s: float = Field(default=0.0, ge=0)
    """Start of the playback, in seconds from the first frame of the prepared sequence."""
    end_s: float | None = Field(default=None, gt=0)
    """End of the playback, in seconds from the same frame; null plays to the end."""
    stop_at_first_loss: bool = False
    """Ends playback at the first track loss, for experiments that only measure whether and when
    it happens."""

    @model_validator(mode="after")
    def _has_length(self) -> "Playback":
        if self.end_s is not None and self.end_s <= self.start_s:
            raise ValueError(f"end_s {self.end_s} is not after start_s {self.start_s}")
        return self

    def meaning(self) -> dict[str, Any]:
        """Returns the part of the run key; an option that is off is left out, so that old keys
        stay valid."""
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
    """Devices of one system; a role that is not given takes the experiment's device."""

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
    label: Annotated[str, *matching(r"^[^/\n]+$", "one line of text without '/'")] | None = None
    """Name of this row in tables; `system` or `system:variant` when not given."""
    profiles: list[str] | None = Field(default=None, min_length=1)
    """The subset of the experiment's link profiles for this system; all when not given."""
    datasets: list[str] | None = Field(default=None, min_length=1)
    """The subset of the experiment's datasets for this system, for example those that have its
    sensor; all when not given."""
    devices: OwnDevices = Field(default_factory=OwnDevices)
    """Replaces the experiment's devices."""
    faults: Faults | None = None
    """Replaces the experiment's faults."""


class LinkChoice(BaseModel):
    """The link between the nodes, and how its latency changes."""

    model_config = STRICT

    backend: Literal["auto", "relay", "netem"] = "auto"
    """What shapes a live link; `auto`: netem where the kernel has it and the profile has no packet
    loss, jitter, gap or rate trace, else the relay."""
    profiles: list[str | float | dict[str, Any]] = Field(min_length=1)
    """Names of netem_profiles/*.yaml, constant RTTs in ms, or inline profiles."""


MOST_RUNS = 10_000
"""Of a combination: the plan of more would take minutes to make."""


class Runs(BaseModel):
    """Repetitions of each cell."""

    model_config = STRICT

    default: int = Field(default=3, ge=1, le=MOST_RUNS)
    """As many as are made without `--runs`."""
    paper: int | None = Field(default=None, ge=1, le=MOST_RUNS)
    """The number of runs in the paper; selected with `--runs paper`."""


class Tolerances(BaseModel):
    """Tolerances of a valid run; a run that exceeds one is invalid."""

    model_config = STRICT

    rtt_error_ms_median: float = Field(default=1.0, gt=0)
    """Median of |measured RTT - commanded RTT| over the run."""
    rtt_error_ms_p99: float | None = Field(default=None, gt=0)
    """99th percentile of the same error; the default is 20 ms over the relay
    (metrics/validity.py)."""
    host_stall_ms_max: float | None = Field(default=None, gt=0)
    """Longest time for which other work on the host stalled the mobile node."""
    cpu_wait_share_max: float | None = Field(default=None, gt=0, le=1)
    """Share of the time that the mobile node's threads spent waiting for a CPU although they
    were ready to run."""


class Report(BaseModel):
    """Metrics and plots that the report shows first; it always contains all others too."""

    model_config = STRICT

    metrics: list[str] = Field(default_factory=list)
    """Keys of summary.json in the first table."""
    plots: list[str] = Field(default_factory=list)
    """Figures that come first: keys of summary.json that are numbers, or `losses`, `trajectory`,
    `rtt`, `cpu`, `memory`, `stages`, `losses_by_profile`, `tradeoff`, `changes`, `sweep`."""


class Experiment(BaseModel):
    """One experiment file."""

    model_config = STRICT

    id: Name
    """Name of the experiment, as of the file."""
    title: Title
    """Heading of the report."""
    reproduces: list[str] = Field(default_factory=list)
    """Ids of papers, tables, figures and claims that the report compares the runs with."""
    systems: list[SystemChoice] = Field(min_length=1)
    """What is compared."""
    datasets: list[str] = Field(min_length=1)
    """Names of datasets, or paths of their YAML files as seen from the experiment."""
    missing_datasets: Literal["refuse", "skip"] = "refuse"
    """Whether a dataset that is not on this machine is an error or is skipped."""
    playback: Playback = Field(default_factory=Playback)
    """How frames are offered to tracking."""
    faults: Faults = Field(default_factory=list)
    """Faults injected into every run of a system with an edge."""
    link: LinkChoice | None = None
    """Link between the nodes; null: no system has an edge."""
    devices: DeviceChoice = Field(default_factory=DeviceChoice)
    """What the nodes run on."""
    roles: Roles | None = None
    """Nodes on another machine: a mobile node on a real board that reaches the edge on this
    machine over the real network (docs/how-to/use-a-real-board.md)."""
    engine: Literal["auto", "docker", "local", "virtual"] = "auto"
    """What executes the runs; `auto`: Docker where its daemon answers, else `local`."""
    pace: Pace = HOST_PACE
    """For live runs: a stage takes the time that this host needs (`host`) or that the device's cost
    model charges (`device`; docs/explanation/limits.md). Virtual runs always use the device's
    pace."""
    runs: Runs = Field(default_factory=Runs)
    """Repetitions of every cell."""
    seed: int = Field(default=1, ge=0, lt=2**31)
    """Repetition k of every cell has the same seed, which follows from this one."""
    max_run_mb: int = Field(default=MAX_RUN_MB, ge=1)
    """What a run may write into its folder, in MiB: files, and what its programs
    print. A run that writes more is ended, with outcome `died`."""
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

    def datasets_of(self, choice: SystemChoice) -> list[str]:
        """Returns the datasets that a system of this experiment plays."""
        return self.datasets if choice.datasets is None else choice.datasets


def has_cuts(experiment: Experiment) -> bool:
    """Returns whether any run has a link cut."""
    return any(cuts(f or []) for f in (experiment.faults, *(c.faults for c in experiment.systems)))


def assumed(experiment: Experiment) -> list[str]:
    """Lists the defaults that an experiment relies on although they change what its runs mean."""
    if "mobile" in experiment.devices.model_fields_set or experiment.roles is not None:
        return []
    own = [choice.devices.mobile is not None for choice in experiment.systems]
    if all(own):
        return []
    return ["devices.mobile is not given: the mobile node is this host, without a slower device"]
