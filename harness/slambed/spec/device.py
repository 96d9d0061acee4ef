# SPDX-License-Identifier: Apache-2.0
"""catalog/devices/*.yaml: what a node may use of this host, and what work costs on the device."""

import math
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from slambed.files.names import Name, Title
from slambed.older_names import STAGES, in_keys
from slambed.suggestion import suggestion

ROUNDING = 1e-3
"""Differences between computed numbers of cores below this are ignored."""
STRICT = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Limits(BaseModel):
    """CPU time and memory of one node, in units of this host. Live engines only."""

    model_config = STRICT

    cores: int | None = Field(default=None, ge=1, le=1024)
    """Number of host CPUs in the node's cpuset; null = all."""
    quota_cores: float | None = Field(default=None, gt=0, le=1024)
    """CPU seconds per second, summed over threads; null = no quota."""
    thread_cores: float | None = Field(default=None, gt=0, le=1)
    """CPU seconds per second of each single thread; null = a thread may use the whole quota."""
    period_ms: float = Field(default=10.0, ge=1, le=1000)
    """Length of a quota period. It is short because a thread that used its share sleeps until
    the next period."""
    memory_mb: int | None = Field(default=None, ge=64, le=2**24)
    """Memory limit in MiB, page cache included; null = none."""

    @model_validator(mode="after")
    def _quota_fits(self) -> "Limits":
        if self.cores and self.quota_cores and self.quota_cores > self.cores:
            raise ValueError(f"quota_cores {self.quota_cores} is more than cores {self.cores}")
        if self.thread_cores and self.quota_cores and self.thread_cores > self.quota_cores:
            raise ValueError(
                f"thread_cores {self.thread_cores} is more than quota_cores {self.quota_cores}"
            )
        return self


class Board(BaseModel):
    """The computer that a node emulates: the limits follow from it and from this host's core
    speed."""

    model_config = STRICT

    cores: int = Field(ge=1, le=1024)
    """Cores of the board."""
    core_speed: float = Field(gt=0)
    """Speed of one core; 1 is a core of the reference host (docs/explanation/limits.md)."""


class StageCost(BaseModel):
    """Compute time of one execution of a stage: a + b*n1 + c*n2 [us], times a log-normal factor."""

    model_config = STRICT

    a_us: float = Field(default=0.0, ge=0)
    """Fixed part, in microseconds."""
    b_us: float = Field(default=0.0, ge=0)
    """Microseconds for each unit of n1."""
    c_us: float = Field(default=0.0, ge=0)
    """Microseconds for each unit of n2."""
    jitter: float = Field(default=0.0, ge=0, le=3)
    """Standard deviation of the logarithm of the cost's random factor, whose median is 1."""
    accelerator: str | None = None
    """The accelerator that executes this stage; null = a CPU core."""

    @model_serializer(mode="wrap")
    def _without_none(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        # Without this, run keys of devices without accelerators would change.
        return {key: value for key, value in serialize(self).items() if value is not None}


class Accelerator(BaseModel):
    """Hardware that computes besides the CPU cores, such as a GPU or a feature extraction unit."""

    model_config = STRICT

    lanes: int = Field(default=1, ge=1, le=1024)
    """Number of jobs that run at full speed at the same time; more jobs share the lanes."""
    speed: float = Field(default=1.0, gt=0)
    """The costs of its stages are divided by this instead of by the device's speed."""


class CostModel(BaseModel):
    """The device's compute costs: what virtual runs charge (docs/explanation/virtual-time.md), and
    live runs with `pace: device`."""

    model_config = STRICT

    cores: int = Field(ge=1, le=1024)
    """Cores that stages share."""
    speed: float = Field(default=1.0, gt=0)
    """Every cost on the cores is divided by it: 2 is a device twice as fast."""
    background: float = Field(default=0.0, ge=0, le=1024)
    """Cores kept busy by work outside the system, such as drivers, a player or a viewer."""
    stages: Annotated[dict[str, StageCost], in_keys(STAGES)]
    """Stage -> what one execution costs."""
    accelerators: dict[str, Accelerator] = Field(default_factory=dict)
    """Name -> what computes beside the cores."""

    @model_validator(mode="after")
    def _accelerators_are_there(self) -> "CostModel":
        for name, cost in self.stages.items():
            if cost.accelerator is not None and cost.accelerator not in self.accelerators:
                raise ValueError(
                    f"stage {name} is done by '{cost.accelerator}', which is none of accelerators"
                )
        return self

    @model_serializer(mode="wrap")
    def _without_empty(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        found: dict[str, Any] = serialize(self)
        if not self.accelerators:
            del found["accelerators"]
        if not self.background:
            del found["background"]
        return found


class Device(BaseModel):
    """A device that a node emulates."""

    model_config = STRICT

    name: str
    """Name of the device, as of the file."""
    title: Title
    """One line for lists and reports."""
    limits: Limits
    """What a live node is limited to."""
    board: Board | None = None
    """Null when all limits are in `limits`, as shares of whichever host executes the run."""
    model: CostModel | None = None
    """Null for a device that supports live runs only."""
    hardware: str = ""
    """Description of the real device."""
    notes: str = ""
    """How the limits were chosen, and what they do not emulate."""

    @model_validator(mode="after")
    def _limits_have_one_source(self) -> "Device":
        if self.board and (self.limits.quota_cores or self.limits.thread_cores):
            raise ValueError(
                "quota_cores and thread_cores follow from board: give one or the other"
            )
        return self

    def limits_on(self, host_speed: float, host_cpus: int) -> Limits:
        """Returns the limits on a host with this core speed (1 = the reference host).

        Each thread gets one core of the board and all threads together get all its cores, but never
        more than the host has. `shortfall` reports what is missing.
        """
        if self.board is None:
            return self.limits
        thread = self.board.core_speed / host_speed
        total = min(thread, 1.0) * self.board.cores
        cores = min(self.limits.cores or math.ceil(total - ROUNDING), host_cpus)
        return self.limits.model_copy(
            update={
                "cores": cores,
                "quota_cores": round(min(total, cores), 4),
                "thread_cores": round(min(thread, 1.0), 4),
            }
        )

    def shortfall(self, limits: Limits, host_speed: float) -> str | None:
        """Describes which part of the board these limits cannot provide on this host; None if
        they suffice."""
        if self.board is None or limits.quota_cores is None or limits.thread_cores is None:
            return None
        thread = self.board.core_speed / host_speed
        lines = []
        if thread > limits.thread_cores + ROUNDING:
            lines.append(f"one of its cores is {thread:.2f} of this host's")
        if (total := thread * self.board.cores) > limits.quota_cores + ROUNDING:
            lines.append(f"all its cores are {total:.2f}, it gets {limits.quota_cores:.2f}")
        return "; ".join(lines) or None

    def share_on(self, limits: Limits) -> float:
        """Returns the share of a host CPU that emulates one core of the device under these
        limits."""
        return min(limits.thread_cores or limits.quota_cores or 1.0, 1.0)

    def meaning(self, engine: str, paced: bool = False) -> dict[str, object]:
        """Returns what enters the run key: board and limits for a live run, the cost model for a
        virtual one, and both for a live run at the device's pace. Descriptions and the host's
        speed do not enter."""
        if paced:
            return self.meaning(engine) | self.meaning(VIRTUAL)
        if engine != VIRTUAL:
            limits = self.limits.model_dump(mode="json")
            # Without this, run keys of devices without `thread_cores` would change.
            if limits["thread_cores"] is None:
                del limits["thread_cores"]
            if self.board is None:
                return {"name": self.name, "limits": limits}
            return {"name": self.name, "limits": limits, "board": self.board.model_dump()}
        model = self.model.model_dump(mode="json") if self.model else None
        return {"name": self.name, "model": model}


LOCAL = "local"
"""Name of the engine that starts programs directly on this host."""
VIRTUAL = "virtual"
"""Name of the engine that charges cost models instead of computing under limits."""


class DeviceChange(BaseModel):
    """A device of catalog/devices/*.yaml with changed cores, speed, costs, jitter or background
    load, for what-if experiments."""

    model_config = STRICT

    device: str
    """Name of the device that is changed."""
    name: Name
    """What tables call the changed device."""
    cores: int | None = Field(default=None, ge=1, le=1024)
    """Another number of cores."""
    speed: float | None = Field(default=None, gt=0)
    """Relative to the speed in the device's file."""
    stages: dict[str, StageCost] = Field(default_factory=dict)
    """Stage -> its new cost, in place of the whole old one."""
    jitter: dict[str, Annotated[float, Field(ge=0, le=3)]] = Field(default_factory=dict)
    """Stage -> new `jitter` of its cost; the median stays."""
    background: float | None = Field(default=None, ge=0, le=1024)
    """New background load, in cores."""

    def applied_to(self, device: Device) -> Device:
        """Returns the changed device. Raises ValueError if it has no cost model or no cost of a
        stage."""
        if device.model is None:
            raise ValueError(f"device {device.name} has no cost model to change")
        changes: dict[str, object] = {}
        if self.cores is not None:
            changes["cores"] = self.cores
        if self.speed is not None:
            changes["speed"] = device.model.speed * self.speed
        if self.background is not None:
            changes["background"] = self.background
        stages = dict(device.model.stages)
        for stage in (*self.stages, *self.jitter):
            if stage not in stages:
                raise ValueError(
                    f"device {device.name} has no cost of stage '{stage}'; "
                    + suggestion(stage, stages)
                )
        stages |= self.stages
        for stage, jitter in self.jitter.items():
            stages[stage] = stages[stage].model_copy(update={"jitter": jitter})
        changes["stages"] = stages
        return device.model_copy(
            update={"name": self.name, "model": device.model.model_copy(update=changes)}
        )
