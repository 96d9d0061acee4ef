# SPDX-License-Identifier: Apache-2.0
"""devices/*.yaml: what a node may use of this host, and what work costs on the device."""

from pydantic import BaseModel, ConfigDict, Field, model_validator

STRICT = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Limits(BaseModel):
    """CPU time and memory of one node, in units of this host. Live engines only."""

    model_config = STRICT

    cores: int | None = Field(default=None, ge=1)
    """Host CPUs that the node may run on (its cpuset); null = all."""
    quota_cores: float | None = Field(default=None, gt=0)
    """CPU seconds per second, summed over threads; null = no quota."""
    period_ms: float = Field(default=10.0, ge=1, le=1000)
    """Length of a quota period. Short, because a thread that used its share sleeps for the rest."""
    memory_mb: int | None = Field(default=None, ge=64)
    """Memory limit in MiB, page cache included; null = none."""

    @model_validator(mode="after")
    def _quota_fits(self) -> "Limits":
        if self.cores and self.quota_cores and self.quota_cores > self.cores:
            raise ValueError(f"quota_cores {self.quota_cores} is more than cores {self.cores}")
        return self


class StageCost(BaseModel):
    """Compute time of one execution of a stage: a + b*n1 + c*n2 [us], times a log-normal factor."""

    model_config = STRICT

    a_us: float = Field(default=0.0, ge=0)
    b_us: float = Field(default=0.0, ge=0)
    c_us: float = Field(default=0.0, ge=0)
    jitter: float = Field(default=0.0, ge=0, le=3)
    """Standard deviation of the factor's logarithm; its median is 1."""


class CostModel(BaseModel):
    """The device as the virtual engine charges it (docs/virtual.md)."""

    model_config = STRICT

    cores: int = Field(ge=1, le=1024)
    speed: float = Field(default=1.0, gt=0)
    """Every cost is divided by it: 2 is a device twice as fast."""
    stages: dict[str, StageCost]


class Device(BaseModel):
    """A device that a node pretends to be."""

    model_config = STRICT

    name: str
    title: str
    limits: Limits
    model: CostModel | None = None
    """null: runs live only."""
    hardware: str = ""
    """The real device, in words."""
    notes: str = ""
    """How the limits were chosen, and what they do not emulate."""

    def meaning(self, engine: str) -> dict[str, object]:
        """What a run depends on: a live one on the limits, a virtual one on the cost model. The
        words about the device may change freely."""
        if engine != VIRTUAL:
            return {"name": self.name, "limits": self.limits.model_dump(mode="json")}
        model = self.model.model_dump(mode="json") if self.model else None
        return {"name": self.name, "model": model}


VIRTUAL = "virtual"
"""Name of the engine that charges cost models instead of computing under limits."""


class DeviceChange(BaseModel):
    """A device of devices/*.yaml with another number of cores or another speed: what if?"""

    model_config = STRICT

    device: str
    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
    cores: int | None = Field(default=None, ge=1, le=1024)
    speed: float | None = Field(default=None, gt=0)
    """Relative to the device as it is in its file."""

    def applied_to(self, device: Device) -> Device:
        """The changed device; ValueError when it has no cost model to change."""
        if device.model is None:
            raise ValueError(f"device {device.name} has no cost model to change")
        changes: dict[str, object] = {}
        if self.cores is not None:
            changes["cores"] = self.cores
        if self.speed is not None:
            changes["speed"] = device.model.speed * self.speed
        return device.model_copy(
            update={"name": self.name, "model": device.model.model_copy(update=changes)}
        )
