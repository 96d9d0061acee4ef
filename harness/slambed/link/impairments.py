# SPDX-License-Identifier: Apache-2.0
"""Impairments of a direction besides the delay: jitter, loss, rate and outages."""

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from slambed.link.curves import LONGEST_MS, SHORTEST_S
from slambed.link.direction import JitterConfig, LossConfig

STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

# The limits below are those of systems/core/link/direction_config.cpp, so that a checked profile is
# never refused by a run. A test compares them.
LARGEST_QUEUE_BYTES = 10**10
LONGEST_CORRELATION_S = 3600.0
HEAVIEST_TAIL = 1.01


class Jitter(BaseModel):
    """Random delay per packet on top of the profile, from a seed; packets are delivered in
    order."""

    model_config = STRICT

    shape: Literal["normal", "pareto"] = "normal"
    """Distribution of the extra delay."""
    sd_ms: float | None = Field(default=None, gt=0, le=LONGEST_MS)
    """normal: standard deviation; the mean is 0, and the total delay never drops below 0. Packets
    keep their order: a late one holds up those behind it, so a dense stream gets longer delays."""
    mean_ms: float | None = Field(default=None, gt=0, le=LONGEST_MS)
    """pareto: mean of the extra delay, which starts at 0."""
    tail: float = Field(default=3.0, ge=HEAVIEST_TAIL, le=100)
    """pareto: tail index; a smaller index means a heavier tail."""
    max_ms: float | None = Field(default=None, gt=0, le=LONGEST_MS)
    """Largest extra delay; null: no bound."""
    correlation: float = Field(default=0.0, ge=0, lt=1)
    """Correlation between successive packets."""
    correlation_s: float | None = Field(default=None, gt=0, le=LONGEST_CORRELATION_S)
    """Time constant of correlation in time, exp(-dt / this), which is independent of the packet
    rate."""

    @model_validator(mode="after")
    def _complete(self) -> "Jitter":
        wanted, other = ("sd_ms", "mean_ms") if self.shape == "normal" else ("mean_ms", "sd_ms")
        if getattr(self, wanted) is None or getattr(self, other) is not None:
            raise ValueError(f"{self.shape} jitter takes {wanted} (not {other})")
        if self.shape == "normal" and "tail" in self.model_fields_set:
            raise ValueError("tail is of pareto jitter; remove it")
        if self.mean_ms is not None and self.max_ms is not None and self.mean_ms >= self.max_ms:
            raise ValueError(f"mean_ms {self.mean_ms:g} is not below max_ms {self.max_ms:g}")
        if self.correlation and self.correlation_s:
            raise ValueError("give correlation or correlation_s, not both")
        return self

    def relay_config(self) -> JitterConfig:
        """Returns the configuration for slambed-relay."""
        scale_ms = self.sd_ms if self.shape == "normal" else self.mean_ms
        assert scale_ms is not None
        return JitterConfig(
            shape=self.shape,
            scale_us=scale_ms * 1e3,
            pareto_shape=self.tail,
            max_us=(self.max_ms or 0.0) * 1e3,
            correlation=self.correlation,
            correlation_time_s=self.correlation_s or 0.0,
        )


class GilbertElliott(BaseModel):
    """Bursty loss: a chain of a good and a bad state, in time or with one step per packet.

    In time (`good_s`, `bad_s`) bursts do not depend on the traffic. Per packet (`to_bad`,
    `to_good`) a burst lasts until enough packets have entered it. A sender that waits for a timeout
    then prolongs the burst, so use this model for continuous streams only.
    """

    model_config = STRICT

    good_s: float | None = Field(default=None, ge=1e-4, le=1e6)
    """Mean duration of the good state (exponential)."""
    bad_s: float | None = Field(default=None, ge=1e-4, le=1e6)
    """Mean duration of a burst."""
    to_bad: float | None = Field(default=None, ge=0, le=1)
    """Transition probability from good to bad, per packet."""
    to_good: float | None = Field(default=None, ge=0, le=1)
    """Bad to good, per packet."""
    loss_good: float = Field(default=0.0, ge=0, le=1)
    """Share of packets lost in the good state."""
    loss_bad: float = Field(default=1.0, ge=0, le=1)
    """Share of packets lost in the bad state."""

    @model_validator(mode="after")
    def _one_chain(self) -> "GilbertElliott":
        in_time = (self.good_s, self.bad_s)
        per_packet = (self.to_bad, self.to_good)
        if (None in in_time) == (None in per_packet) or any(
            value is not None for value in (per_packet if None not in in_time else in_time)
        ):
            raise ValueError("give good_s and bad_s (bursts in time), or to_bad and to_good")
        return self

    def bad_share(self) -> float:
        """Returns the share of the time, or of the packets, in the bad state."""
        if self.good_s is not None and self.bad_s is not None:
            return self.bad_s / (self.bad_s + self.good_s)
        assert self.to_bad is not None and self.to_good is not None
        turns = self.to_bad + self.to_good
        return self.to_bad / turns if turns > 0 else 0.0


class PacketLoss(BaseModel):
    """Random packet loss from a seed. All values are probabilities, 0..1."""

    model_config = STRICT

    random: float | None = Field(default=None, ge=0, le=1)
    """Loss probability of each packet, independent of the others."""
    gilbert_elliott: GilbertElliott | None = None
    """Bursts of loss."""

    @model_validator(mode="after")
    def _one(self) -> "PacketLoss":
        if (self.random is None) == (self.gilbert_elliott is None):
            raise ValueError("give one of random, gilbert_elliott")
        return self

    def relay_config(self) -> LossConfig:
        """Returns the configuration for slambed-relay; for independent loss the chain stays in
        its good state."""
        if self.gilbert_elliott is not None:
            return LossConfig(**self.gilbert_elliott.model_dump(exclude_none=True))
        return LossConfig(to_bad=0.0, to_good=1.0, loss_good=self.random or 0.0, loss_bad=1.0)

    def mean(self) -> float:
        """Returns the expected share of lost packets."""
        if (chain := self.gilbert_elliott) is None:
            return self.random or 0.0
        bad = chain.bad_share()
        return bad * chain.loss_bad + (1 - bad) * chain.loss_good


class Bandwidth(BaseModel):
    """Bandwidth of the bottleneck: a constant rate or a Mahimahi trace, with a queue in bytes."""

    model_config = STRICT

    mbps: float | None = Field(default=None, ge=0.001, le=100_000)
    """Constant rate in Mbit/s."""
    trace: str | None = None
    """Path of a Mahimahi file; it repeats from its start when it ends."""
    queue_bytes: int | None = Field(default=None, ge=3000, le=LARGEST_QUEUE_BYTES)
    """Default: what the mean rate carries in 200 ms, at least 64 KiB."""

    @model_validator(mode="after")
    def _one(self) -> "Bandwidth":
        if (self.mbps is None) == (self.trace is None):
            raise ValueError("give one of mbps, trace")
        return self


class Gap(BaseModel):
    """An outage, as in a handover: no packet arrives for a while."""

    model_config = STRICT

    start_s: float = Field(ge=0, le=1e6)
    """Run time at which it begins."""
    length_s: float = Field(gt=0, le=1e6)
    """How long nothing arrives."""
    every_s: float | None = Field(default=None, ge=SHORTEST_S, le=1e6)
    """Repeats the outage with this period."""

    @model_validator(mode="after")
    def _apart(self) -> "Gap":
        if self.every_s is not None and self.every_s <= self.length_s:
            raise ValueError("every_s is not longer than length_s: the link would never be there")
        return self

    def within(self, horizon_s: float) -> list[tuple[float, float]]:
        """Returns [start, end] of each outage that begins before the horizon."""
        found = []
        start = self.start_s
        while start < horizon_s:
            found.append((start, start + self.length_s))
            if self.every_s is None:
                break
            start += self.every_s
        return found


def outages_within(content: Mapping[str, Any], horizon_s: float) -> list[tuple[float, float]]:
    """Returns [start, end] in s of the outages that a profile's content asks for before the
    horizon; none where the content is damaged."""
    gaps = content.get("gaps")
    try:
        asked = [Gap.model_validate(gap) for gap in gaps] if isinstance(gaps, list) else []
    except ValidationError:
        return []
    return [span for gap in asked for span in gap.within(horizon_s)]


class Side(BaseModel):
    """The impairments of one direction."""

    model_config = STRICT

    jitter: Jitter | None = None
    loss: PacketLoss | None = None
    rate: Bandwidth | None = None
