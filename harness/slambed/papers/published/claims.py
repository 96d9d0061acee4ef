# SPDX-License-Identifier: Apache-2.0
"""Sentences of a paper that state a number or an ordering."""

from typing import Any, Literal

from pydantic import Field, model_validator

from slambed.papers.published.base import Number, Strict
from slambed.papers.published.comparability import Comparability
from slambed.papers.published.quantities import Quantity

Operator = Literal["eq", "about", "lt", "le", "gt", "ge", "up_to", "set", "range"]
"""eq: the printed number. about: `about`, `nearly`. lt, gt, le, ge: `less than`, `more than`, `at
most`, `at least`. up_to: the largest of several. set: several numbers. range: both ends."""

BOUNDS = ("lt", "le", "gt", "ge")


class Configured(Strict):
    """Where our configuration has a value that the paper sets: in exactly one of a system, a
    profile or a dataset."""

    system: str | None = None
    """A system whose parameter has the value."""
    variant: str | None = None
    """Variant of that system."""
    param: str | None = None
    """Parameter of that system (systems/<system>/system.yaml), with the variant's value."""
    profile: str | None = None
    """A link profile whose file has the value."""
    dataset: str | None = None
    """A dataset whose file has the value."""
    key: str | None = None
    """Dotted path in netem_profiles/<profile>.yaml or catalog/datasets/<dataset>.yaml."""
    scale: float = 1.0
    """Paper's unit = scale * our unit."""

    @model_validator(mode="after")
    def _one_place(self) -> "Configured":
        places = [self.system is not None, self.profile is not None, self.dataset is not None]
        if sum(places) != 1:
            raise ValueError("configured names one of system, profile, dataset")
        if (self.system is not None) != (self.param is not None):
            raise ValueError("a system is named with its param")
        if (self.system is None) != (self.key is not None):
            raise ValueError("a profile or dataset is named with its key")
        return self


class Claim(Comparability):
    """A sentence of the paper that states a number or an ordering."""

    id: str
    """Name, unique in the paper."""
    kind: Literal["result", "setup", "parameter", "background", "qualitative"]
    """What the sentence is about."""
    metric: str
    """Key of `metrics`."""
    system: str | None
    """Key of `systems`; null: none in particular."""
    conditions: dict[str, Any]
    """Condition -> value, where it holds."""
    op: Operator | None
    """How the sentence states the value: exactly, about, as a bound, as a set or as a range."""
    value: Number | str | list[Number] | None
    """The printed value."""
    unit: str | None
    """Its unit."""
    where: str
    """Place in the paper."""
    lines: list[int] = Field(default_factory=list)
    """Lines of the paper's plain text with the statement."""
    recomputed: Number | None = None
    """The number recomputed from the paper's own cells."""
    quantity: Quantity | None = None
    """What the number is, if it is computed from several cells."""
    configured: Configured | None = None
    """Where the lint must find the same value in our configuration."""
    note: str = ""
    """What a reader must know."""

    @model_validator(mode="after")
    def _value_fits_operator(self) -> "Claim":
        if self.op in ("set", "range") and self.value is not None:
            if not isinstance(self.value, list):
                raise ValueError(f"{self.id}: {self.op} needs a list")
            if self.op == "range" and (len(self.value) != 2 or self.value[0] > self.value[1]):
                raise ValueError(f"{self.id}: a range is [low, high]")
        elif isinstance(self.value, list):
            raise ValueError(f"{self.id}: a list needs op set or range")
        return self
