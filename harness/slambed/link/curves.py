# SPDX-License-Identifier: Apache-2.0
"""Curves: delays in ms as pure functions of run time, the building blocks of a profile.

In YAML a curve is a number (constant) or a mapping whose single key is the kind: `sine: {mean_ms:
40, amplitude_ms: 30, period_s: 43}`.
"""

from itertools import pairwise
from typing import Annotated, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

Times = NDArray[np.float64]

LONGEST_MS = 60_000.0
"""One way; a longer delay is taken for a wrong unit."""
SHORTEST_S = 1e-3
"""Shortest period of outages that repeat."""
SHORTEST_WAVE_S = 0.04
"""Shortest period of a curve that repeats: links evaluate it every 10 ms."""
STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Curve(Protocol):
    """A delay in ms over run time."""

    def at(self, t: Times) -> Times:
        """Returns the values at the times `t` [s]; the value at 0 holds before 0."""

    def duration_s(self) -> float | None:
        """Returns the time after which the value is constant; None for a curve that never
        settles."""


class Constant(BaseModel):
    """A constant value."""

    model_config = STRICT
    kind: ClassVar[str] = "constant"

    value_ms: float

    def at(self, t: Times) -> Times:
        return np.full_like(t, self.value_ms)

    def duration_s(self) -> float | None:
        return 0.0


def _in_order(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    times = [time for time, _ in points]
    if any(time < 0 for time in times):
        raise ValueError(f"time {min(times):g} s is negative")
    for earlier, later in pairwise(times):
        if later <= earlier:
            raise ValueError(f"time goes from {earlier:g} s to {later:g} s; times must increase")
    return points


Points = Annotated[list[tuple[float, float]], Field(min_length=1), AfterValidator(_in_order)]


class Steps(BaseModel):
    """A step function: each value holds from its time until the next one."""

    model_config = STRICT
    kind: ClassVar[str] = "steps"

    points: Points
    """[time s, ms] pairs."""

    def at(self, t: Times) -> Times:
        times, values = np.array(self.points).T
        index = np.searchsorted(times, t, side="right") - 1
        held: Times = values[np.clip(index, 0, None)]
        return held

    def duration_s(self) -> float | None:
        """Time of the last step."""
        return self.points[-1][0]


class Line(BaseModel):
    """Linear interpolation between points; the first and the last value hold outside."""

    model_config = STRICT
    kind: ClassVar[str] = "points"

    points: Points
    """[time s, ms] pairs."""

    def at(self, t: Times) -> Times:
        times, values = np.array(self.points).T
        between: Times = np.interp(t, times, values)
        return between

    def duration_s(self) -> float | None:
        """Time of the last point."""
        return self.points[-1][0]


class Ramp(BaseModel):
    """A linear rise (or fall), a plateau, and a linear return."""

    model_config = STRICT
    kind: ClassVar[str] = "ramp"

    from_ms: float = 0.0
    """Value before and after."""
    to_ms: float
    """Value of the plateau."""
    start_s: float = Field(default=0.0, ge=0)
    """When the rise begins."""
    rise_s: float = Field(gt=0)
    """Length of the rise."""
    hold_s: float = Field(default=0.0, ge=0)
    """Length of the plateau."""
    fall_s: float = Field(default=0.0, ge=0)
    """0 stays at `to_ms`."""

    def at(self, t: Times) -> Times:
        top = self.start_s + self.rise_s
        times = [self.start_s, top, top + self.hold_s]
        values = [self.from_ms, self.to_ms, self.to_ms]
        if self.fall_s > 0:
            times.append(times[-1] + self.fall_s)
            values.append(self.from_ms)
        shape: Times = np.interp(t, times, values)
        return shape

    def duration_s(self) -> float | None:
        """End of the return."""
        return self.start_s + self.rise_s + self.hold_s + self.fall_s


class Sine(BaseModel):
    """`mean + amplitude * sin(2 pi t / period + phase)`; before time 0 the value at 0 holds."""

    model_config = STRICT
    kind: ClassVar[str] = "sine"

    mean_ms: float = 0.0
    """Mean of the wave."""
    amplitude_ms: float
    """Amplitude of the wave."""
    period_s: float = Field(ge=SHORTEST_WAVE_S)
    """Period of the wave."""
    phase_deg: float = 0.0
    """Phase at run time 0."""

    def at(self, t: Times) -> Times:
        angle = 2 * np.pi * np.maximum(t, 0.0) / self.period_s + np.radians(self.phase_deg)
        wave: Times = self.mean_ms + self.amplitude_ms * np.sin(angle)
        return wave

    def duration_s(self) -> float | None:
        return None


class Sum(BaseModel):
    """The sum of curves."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)
    kind: ClassVar[str] = "sum"

    parts: list[Any] = Field(min_length=1)

    def at(self, t: Times) -> Times:
        total: Times = np.sum([part.at(t) for part in self.parts], axis=0)
        return total

    def duration_s(self) -> float | None:
        """Time at which the last part has settled."""
        ends = [part.duration_s() for part in self.parts]
        return None if None in ends else max(ends)


class Wrapped(BaseModel):
    """A curve derived from another one."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, arbitrary_types_allowed=True
    )
    plays_on: ClassVar[bool] = True
    """Whether a longer run plays more of the other curve."""

    of: Any
    """The curve that is changed."""


class Clamp(Wrapped):
    """Another curve, clamped to `min_ms` and `max_ms`."""

    kind: ClassVar[str] = "clamp"

    min_ms: float = 0.0
    """Lowest value."""
    max_ms: float | None = None
    """Highest value; null: no bound."""

    @model_validator(mode="after")
    def _ordered(self) -> "Clamp":
        if self.max_ms is not None and self.max_ms < self.min_ms:
            raise ValueError(f"max_ms {self.max_ms:g} is below min_ms {self.min_ms:g}")
        return self

    def at(self, t: Times) -> Times:
        cut: Times = np.clip(self.of.at(t), self.min_ms, self.max_ms)
        return cut

    def duration_s(self) -> float | None:
        end: float | None = self.of.duration_s()
        return end


class Scale(Wrapped):
    """Another curve times a factor."""

    kind: ClassVar[str] = "scale"

    factor: float = Field(ge=0)
    """What every value is multiplied by."""

    def at(self, t: Times) -> Times:
        scaled: Times = self.factor * self.of.at(t)
        return scaled

    def duration_s(self) -> float | None:
        end: float | None = self.of.duration_s()
        return end


class Delayed(Wrapped):
    """Another curve, shifted to begin later; its first value holds until then."""

    kind: ClassVar[str] = "delayed"

    by_s: float = Field(ge=0)
    """Seconds by which it begins later."""

    def at(self, t: Times) -> Times:
        later: Times = self.of.at(np.maximum(t - self.by_s, 0.0))
        return later

    def duration_s(self) -> float | None:
        end: float | None = self.of.duration_s()
        return None if end is None else end + self.by_s


class Repeat(Wrapped):
    """The first `period_s` of another curve, repeated forever."""

    kind: ClassVar[str] = "repeat"
    plays_on: ClassVar[bool] = False

    period_s: float = Field(ge=SHORTEST_WAVE_S)
    """Length of the part that repeats."""

    def at(self, t: Times) -> Times:
        again: Times = self.of.at(np.mod(np.maximum(t, 0.0), self.period_s))
        return again

    def duration_s(self) -> float | None:
        return None


class Trace(BaseModel):
    """A recorded series (`slambed.link.traces` reads the files)."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)
    kind: ClassVar[str] = "trace"

    times_s: Any
    values_ms: Any
    hold: bool = False
    """Uses a step function instead of linear interpolation."""

    def at(self, t: Times) -> Times:
        """The last sample holds after the end."""
        if self.hold:
            index = np.searchsorted(self.times_s, t, side="right") - 1
            held: Times = self.values_ms[np.clip(index, 0, None)]
            return held
        between: Times = np.interp(t, self.times_s, self.values_ms)
        return between

    def duration_s(self) -> float | None:
        """Length of the recording."""
        return float(self.times_s[-1])


PLAIN: dict[str, type[BaseModel]] = {c.kind: c for c in (Ramp, Sine)}
"""Kinds whose YAML consists of their fields."""
LISTS: dict[str, type[BaseModel]] = {c.kind: c for c in (Steps, Line)}
"""Kinds whose YAML is a list of [time s, ms] pairs."""
WRAPPERS: dict[str, type[Wrapped]] = {c.kind: c for c in (Clamp, Scale, Delayed, Repeat)}
"""Kinds with a curve under `of`."""
KINDS = ["constant", "sum", "trace", *PLAIN, *LISTS, *WRAPPERS]
