# SPDX-License-Identifier: Apache-2.0
"""The definition of a metric: key, type, unit, meaning, which direction is better, and where it
is shown."""

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
    """Where a report uses a metric by default."""

    ASKED = 0
    """Only on request of an experiment."""
    SHOWN = auto()
    """In the tables of every experiment, after the requested metrics."""
    DRAWN = auto()
    """In its own figure, after the requested ones."""
    TESTED = auto()
    """Tested between the systems of an experiment that names no metrics."""
    GATED = auto()
    """Checked by the nightly regression gate."""


@dataclass(frozen=True)
class Metric:
    """One key of summary.json: how it is computed and shown."""

    key: str
    doc: str
    """Meaning, for docs/reference/summary.md."""
    function: Function | None = field(default=None, compare=False)
    """Computes the value for a run, None if it cannot be measured. Keys that judge the run
    (`valid`) have no function."""
    label: str = ""
    unit: str = ""
    """Unit of the stored value."""
    shown: str = ""
    """Unit in tables and figures, if it differs."""
    scale: float = 1.0
    """Shown value = scale * stored value."""
    digits: int = 1
    better: Better = "neither"
    kind: Kind = "median"
    relevant_share: float = 0.10
    """The regression gate ignores a change of the median that is smaller than this share of the
    baseline ..."""
    relevant_step: float = 0.0
    """... or smaller than this value (in the stored unit)."""
    type: ValueType = "number"
    use: Use = Use.ASKED
    live_only: bool = False
    """Virtual runs have no value: their link, limits and host are models."""
    null_without: tuple[str, str] = ("", "")
    """Key of a count, and what is true where it is 0 in every run: this metric is null then."""

    @property
    def meaning(self) -> str:
        """The doc, and whether only live runs have a value."""
        return f"live runs only: {self.doc}" if self.live_only else self.doc

    def judged(self, change: float, otherwise: str) -> str:
        """Returns whether this change of the value is `better` or `worse`; `otherwise` where
        neither can be said."""
        if self.better == "neither" or change == 0:
            return otherwise
        return "better" if (change > 0) == (self.better == "higher") else "worse"

    @property
    def shown_unit(self) -> str:
        """Unit in tables and figures."""
        return self.shown or self.unit

    @property
    def heading(self) -> str:
        """Label and unit."""
        return f"{self.name} [{self.shown_unit}]" if self.shown_unit else self.name

    @property
    def name(self) -> str:
        """The label, or else the key as words."""
        return self.label or self.key.replace("_", " ")

    @property
    def title(self) -> str:
        """The name with an initial capital."""
        return self.name[0].upper() + self.name[1:]

    @property
    def look(self) -> str:
        """Everything that determines how the metric is shown."""
        return f"{self.heading} {self.scale} {self.digits} {self.better} {self.kind}"

    @property
    def stored_type(self) -> str:
        """Type name in docs/reference/summary.md."""
        return {"number": "float", "count": "int", "flag": "bool", "text": "str"}[self.type]

    @property
    def largest_shown(self) -> float:
        """Upper end of the scale: shares of 0 to 1 are shown in percent."""
        return 100.0 if self.shown == "%" and self.scale == 100 else float("inf")

    @property
    def is_number(self) -> bool:
        """True except for text; a flag counts as the share of runs that have it."""
        return self.type != "text"

    def value_of(self, run: RunData) -> Value:
        """Computes the value for a run, None if it cannot be measured in this run."""
        if self.function is None or (self.live_only and run.is_virtual):
            return None
        return self.function(run)

    def accepts(self, value: object) -> bool:
        """Returns whether a stored value has this metric's type; null always does."""
        if value is None:
            return True
        if self.type != "flag" and isinstance(value, bool):
            return False
        return isinstance(value, PYTHON_TYPES[self.type])

    def show(self, value: float | None) -> str:
        """Formats the value in the shown unit; a dash if it was not measured. The median of two
        counts may lie between them: 0.5 stays 0.5."""
        if value is None or value != value:
            return "-"
        if value == float("inf"):
            return "failed"
        value *= self.scale
        between = self.type == "count" and not self.digits and round(value % 1, 6) not in (0, 1)
        return f"{value:.{1 if between else self.digits}f}"
