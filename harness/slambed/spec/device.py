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

from slambed.older_names import STAGES, in_keys

ROUNDING = 1e-3
"""Differences of computed cores that mean nothing."""
STRICT = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Limits(BaseModel):
    """CPU time and memory of one node, in units of this host. Live engines only."""

    model_config = STRICT

    cores: int | None = Field(default=None, ge=1)
    """Host CPUs that the node may run on (its cpuset); null = all."""
    quota_cores: float | None = Field(default=None, gt=0)
    """CPU seconds per second, summed over threads; null = no quota."""
    thread_cores: float | None = Field(default=None, gt=0, le=1)
    """CPU seconds per second of each single thread; null = a thread may use the whole quota."""
    period_ms: float = Field(default=10.0, ge=1, le=1000)
    """Length of a quota period. Short, because a thread that used its share sleeps for the rest."""
    memory_mb: int | None = Field(default=None, ge=64)
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
    """The computer a node pretends to be: limits follow from it and from this host's speed."""

    model_config = STRICT

    cores: int = Field(ge=1, le=1024)
    """Cores of the board."""
    core_speed: float = Field(gt=0)
    """Speed of one core; 1 is a core of the reference host (docs/limits.md)."""


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
    """Standard deviation of the factor's logarithm; its median is 1."""
    accelerator: str | None = None
    """The accelerator that does this work; null = a core."""

    @model_serializer(mode="wrap")
    def _without_none(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        # Keys of devices without accelerators stay what they were.
        return {key: value for key, value in serialize(self).items() if value is not None}


class Accelerator(BaseModel):
    """What computes beside the cores: a GPU, an extractor in hardware."""

    model_config = STRICT

    lanes: int = Field(default=1, ge=1, le=1024)
    """Pieces of work at once, each at full speed; more than that share them."""
    speed: float = Field(default=1.0, gt=0)
    """Costs of stages on it are divided by this, not by the device's speed."""


class CostModel(BaseModel):
    """The device as the virtual engine charges it (docs/virtual.md)."""

    model_config = STRICT

    cores: int = Field(ge=1, le=1024)
    """Cores that stages share."""
    speed: float = Field(default=1.0, gt=0)
    """Every cost is divided by it: 2 is a device twice as fast."""
    background: float = Field(default=0.0, ge=0, le=1024)
    """Cores that are busy with what is no part of the system: drivers, a player, a viewer."""
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
    """A device that a node pretends to be."""

    model_config = STRICT

    name: str
    """Name of the device, as of the file."""
    title: str
    """One line for lists and reports."""
    limits: Limits
    """What a live node is limited to."""
    board: Board | None = None
    """null: the limits are all in `limits`, as shares of whatever host it is."""
    model: CostModel | None = None
    """null: runs live only."""
    hardware: str = ""
    """The real device, in words."""
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
        """The limits on a host whose cores have this speed (1 = the reference host's).

        Each thread gets a core of the board, all threads together its cores, and neither more
        than there is: `shortfall` reports what is missing.
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
        """What of the board the limits cannot give on this host; None when they give it all."""
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
        """Of a CPU of this host that one core of the device is under its limits."""
        return min(limits.thread_cores or limits.quota_cores or 1.0, 1.0)

    def meaning(self, engine: str, paced: bool = False) -> dict[str, object]:
        """What a run depends on: a live one on board and limits, a virtual one on the cost model, a
        live one at the device's pace on both. The words about the device may change freely, and so
        may the speed of the host."""
        if paced:
            return self.meaning(engine) | self.meaning(VIRTUAL)
        if engine != VIRTUAL:
            limits = self.limits.model_dump(mode="json")
            # Keys of devices without it stay what they were.
            if limits["thread_cores"] is None:
                del limits["thread_cores"]
            if self.board is None:
                return {"name": self.name, "limits": limits}
            return {"name": self.name, "limits": limits, "board": self.board.model_dump()}
        model = self.model.model_dump(mode="json") if self.model else None
        return {"name": self.name, "model": model}


LOCAL = "local"
"""Name of the engine that starts programs of this host."""
VIRTUAL = "virtual"
"""Name of the engine that charges cost models instead of computing under limits."""


class DeviceChange(BaseModel):
    """A device of catalog/devices/*.yaml with other cores, another speed, other spreads or another
    background load: what if?"""

    model_config = STRICT

    device: str
    """Name of the device that is changed."""
    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
    """What tables call the changed device."""
    cores: int | None = Field(default=None, ge=1, le=1024)
    """Another number of cores."""
    speed: float | None = Field(default=None, gt=0)
    """Relative to the device as it is in its file."""
    jitter: dict[str, Annotated[float, Field(ge=0, le=3)]] = Field(default_factory=dict)
    """Stage -> another `jitter` of its cost; the median stays."""
    background: float | None = Field(default=None, ge=0, le=1024)
    """Another background load, in cores."""

    def applied_to(self, device: Device) -> Device:
        """The changed device; ValueError when there is nothing to change."""
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
        for stage, jitter in self.jitter.items():
            if stage not in stages:
                raise ValueError(f"device {device.name} has no cost of stage '{stage}'")
            stages[stage] = stages[stage].model_copy(update={"jitter": jitter})
        changes["stages"] = stages
        return device.model_copy(
            update={"name": self.name, "model": device.model.model_copy(update=changes)}
        )
