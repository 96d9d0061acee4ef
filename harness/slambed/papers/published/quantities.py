# SPDX-License-Identifier: Apache-2.0
"""Numbers that a paper states about several of its cells: reductions, ratios, maxima, time
windows."""

from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from slambed.papers.published.base import Strict

Direction = Literal["rises", "falls"]


class At(Strict):
    """Coordinates without a cell: a metric of a system under conditions."""

    metric: str
    """Key of `metrics`."""
    system: str
    """Key of `systems`."""
    conditions: dict[str, Any] = Field(default_factory=dict)
    """Condition -> value."""


Operand = str | At
"""Id of a cell, a claim or a point of a figure, or coordinates if nothing is printed there."""


class Ratio(Strict):
    """of / base."""

    kind: Literal["ratio"]
    """Names the quantity."""
    of: Operand
    """What is divided or subtracted from."""
    base: Operand
    """What it is compared with."""

    def operands(self) -> list[Operand]:
        """Returns what it is computed from."""
        return [self.of, self.base]


class Reduction(Ratio):
    """1 - of / base, in percent, for something that should be small."""

    kind: Literal["reduction"]  # type: ignore[assignment]
    """Names the quantity."""


class Difference(Ratio):
    """of - base, in the metric's unit."""

    kind: Literal["difference"]  # type: ignore[assignment]
    """Names the quantity."""


class Increase(Ratio):
    """of / base - 1, in percent."""

    kind: Literal["increase"]  # type: ignore[assignment]
    """Names the quantity."""


class Gap(Ratio):
    """How far of is from base, either way: |1 - of / base|, in percent."""

    kind: Literal["gap"]  # type: ignore[assignment]
    """Names the quantity."""


class MaxOver(Strict):
    """The largest of several, as in `up to`, for example over the paper's sequences. Either all are
    reductions (in percent), or all are differences (in the cells' unit)."""

    kind: Literal["max_over"]
    """Names the quantity."""
    over: (
        Annotated[list[Reduction], Field(min_length=1)]
        | Annotated[list[Difference], Field(min_length=1)]
    )
    """Reductions, or differences, of which the largest counts."""

    def operands(self) -> list[Operand]:
        """Returns what it is computed from."""
        return [operand for part in self.over for operand in part.operands()]


class Each(Strict):
    """One number that is stated for each of several cells, or of several differences between
    cells, in the metric's unit."""

    kind: Literal["each"]
    """Names the quantity."""
    of: (
        Annotated[list[Operand], Field(min_length=2)]
        | Annotated[list[Difference], Field(min_length=2)]
    )
    """The cells, or the differences."""

    def operands(self) -> list[Operand]:
        """Returns the cells that it is stated for, or that the differences are between."""
        return [
            operand
            for part in self.of
            for operand in (part.operands() if isinstance(part, Difference) else [part])
        ]


class WindowShare(Strict):
    """Share of the track losses of `of` that begin in a time window of the sequence, or of its runs
    with such a loss; in percent."""

    kind: Literal["window_share"]
    """Names the quantity."""
    of: Operand
    """The cell whose runs are looked at."""
    from_s: float = Field(ge=0)
    """Sequence time at which the window begins."""
    to_s: float = Field(gt=0)
    """Sequence time at which the window ends."""
    per: Literal["losses", "runs"] = "losses"
    """What the share is of."""

    @model_validator(mode="after")
    def _window(self) -> "WindowShare":
        if self.to_s <= self.from_s:
            raise ValueError("a window ends after it begins")
        return self

    def operands(self) -> list[Operand]:
        """Returns what it is computed from."""
        return [self.of]


class EventTimes(Strict):
    """Run times at which something happens, in the claim's order: as many as the claim has
    values."""

    kind: Literal["event_times"]
    """Names the quantity."""
    of: Operand
    """The cell whose runs are looked at."""
    event: str
    """Type of the event, as in events.jsonl."""

    def operands(self) -> list[Operand]:
        """Returns what it is computed from."""
        return [self.of]


class Trend(Strict):
    """A value that rises or falls along cells in the given order."""

    kind: Literal["trend"]
    """Names the quantity."""
    cells: Annotated[list[Operand], Field(min_length=3)]
    """The cells in their order."""
    direction: Direction
    """What the paper says of them."""

    def operands(self) -> list[Operand]:
        """Returns what it is computed from."""
        return list(self.cells)


def computed(quantity: "Quantity", value_of: Callable[[Operand], float | None]) -> float | None:
    """Computes the number in percent (reduction, increase, gap), as a ratio, or in the metric's
    unit (difference). None if an operand has no value, and for quantities that are not a function
    of values (each, windows, times, trends)."""
    if isinstance(quantity, MaxOver):
        parts = [computed(part, value_of) for part in quantity.over]
        known = [part for part in parts if part is not None]
        return max(known) if len(known) == len(parts) else None
    if isinstance(quantity, Each | WindowShare | EventTimes | Trend):
        return None
    of, base = value_of(quantity.of), value_of(quantity.base)
    if of is None or base is None:
        return None
    if isinstance(quantity, Difference):
        return of - base
    if isinstance(quantity, Increase):
        return 100 * (of / base - 1)
    if isinstance(quantity, Gap):
        return 100 * abs(1 - of / base)
    return 100 * (1 - of / base) if isinstance(quantity, Reduction) else of / base


Quantity = Annotated[
    Reduction
    | Increase
    | Gap
    | Ratio
    | Difference
    | MaxOver
    | Each
    | WindowShare
    | EventTimes
    | Trend,
    Field(discriminator="kind"),
]
