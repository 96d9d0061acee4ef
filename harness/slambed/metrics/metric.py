# SPDX-License-Identifier: Apache-2.0
"""What a number of a run is: key, type, unit, meaning, what would be worse, and who shows it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Flag, auto
from typing import Literal

from slambed.metrics.run_data import RunData
from slambed.metrics.summary import Value

Better = Literal["lower", "higher", "neither"]
Kind = Literal["median", "share"]
ValueType = Literal["number", "count", "flag", "text"]
Function = Callable[[RunData], Value]

PYTHON_TYPES: dict[ValueType, tuple[type, ...]] = {
    "number": (int, float), "count": (int, float), "flag": (bool,), "text": (str,),
}  # fmt: skip


class Use(Flag):
    """Where a report takes a metric without being asked for it."""

    ASKED = 0
    """Only where an experiment asks for it."""
    SHOWN = auto()
    """In the tables of every experiment, after what the experiment asks for."""
    DRAWN = auto()
    """A figure of its own, after those that the experiment asks for."""
    TESTED = auto()
    """Between the systems of an experiment that names no metrics."""
    GATED = auto()
    """By the nightly regression gate."""


@dataclass(frozen=True)
class Metric:
    """One key of summary.json: how it comes about, and how tables and figures show it."""

    key: str
    doc: str
    """Meaning, for docs/reference/summary.md."""
    function: Function | None = field(default=None, compare=False)
    """Its value for a run, None where it cannot be measured; without a function: what decides
    about the run (`outcome`, `valid`) or names it."""
    label: str = ""
    unit: str = ""
    """Of the stored value."""
    shown: str = ""
    """In which it is shown, where that is another one."""
    scale: float = 1.0
    """Shown value = scale * stored value."""
    digits: int = 1
    better: Better = "neither"
    kind: Kind = "median"
    relevant_share: float = 0.10
    """The regression gate ignores a change of the median that is smaller than this share of the
    baseline ..."""
    relevant_step: float = 0.0
    """... or smaller than this (in the stored unit)."""
    type: ValueType = "number"
    use: Use = Use.ASKED

    @property
    def shown_unit(self) -> str:
        """The unit of tables and figures."""
        return self.shown or self.unit

    @property
    def heading(self) -> str:
        """Label and unit."""
        return f"{self.name} [{self.shown_unit}]" if self.shown_unit else self.name

    @property
    def name(self) -> str:
        """The label, else the key in words."""
        return self.label or self.key.replace("_", " ")

    @property
    def title(self) -> str:
        """The name at the beginning of a line."""
        return self.name[0].upper() + self.name[1:]

    @property
    def look(self) -> str:
        """All that decides how it is shown."""
        return f"{self.heading} {self.scale} {self.digits} {self.better} {self.kind}"

    @property
    def stored_type(self) -> str:
        """As docs/reference/summary.md says it."""
        return {"number": "float", "count": "int", "flag": "bool", "text": "str"}[self.type]

    @property
    def largest_shown(self) -> float:
        """The end of the scale: fractions of 0 to 1 are shown in percent."""
        return 100.0 if self.shown == "%" and self.scale == 100 else float("inf")

    @property
    def is_number(self) -> bool:
        """Flags count as the share of runs that have them."""
        return self.type != "text"

    def accepts(self, value: object) -> bool:
        """Whether a stored value is of this metric's type; null always is."""
        if value is None:
            return True
        if self.type != "flag" and isinstance(value, bool):
            return False
        return isinstance(value, PYTHON_TYPES[self.type])

    def show(self, value: float | None) -> str:
        """The value in the shown unit; a dash when not measured."""
        if value is None or value != value:
            return "-"
        if value == float("inf"):
            return "failed"
        return f"{value * self.scale:.{self.digits}f}"
