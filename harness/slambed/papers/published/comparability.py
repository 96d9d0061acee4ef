# SPDX-License-Identifier: Apache-2.0
"""What must be known about a published number before it is judged."""

from typing import Any, Literal

from pydantic import model_validator

from slambed.papers.published.base import Number, Strict

Declared = Literal["field_study", "not_in_print", "not_measured"]
"""field_study: measured at the authors' sites or with their devices. not_in_print: the print gives
no number that a run could be compared with. not_measured: no metric of ours."""


class Erratum(Strict):
    """A place where the paper contradicts itself. It takes exactly one of `judge_as` and `skip`."""

    why: str
    """What contradicts what."""
    judge_as: Number | str | None = None
    """What is judged instead: a number, or the id of a cell or claim."""
    skip: bool = False
    """True if nothing can be judged."""

    @model_validator(mode="after")
    def _one_of_them(self) -> "Erratum":
        if (self.judge_as is None) != self.skip:
            raise ValueError("an erratum says either judge_as or skip")
        return self


class Comparability(Strict):
    """Comparability of a table, a row, one cell or a claim; the smaller part takes precedence."""

    unmappable: str | None = None
    """Why we have no number for it. Without a reason, the lint requires a mapping that resolves."""
    reason: Declared | None = None
    """Why it has no number of ours, in one word for counts; beside `unmappable`, and
    `not_measured` if not given."""
    parameter: str | None = None
    """Where our configuration has this value, if it is a setting or a property of the data, not a
    result."""
    same_data: str | None = None
    """The printed input that ours is computed from, so agreement is no evidence."""
    duplicate_of: str | None = None
    """Id of the cell or claim that is counted instead; this one shows its verdict."""
    erratum: Erratum | None = None
    """Where the paper contradicts itself."""
    read_as: str | None = None
    """How we read it if the paper is ambiguous, in a sentence."""

    @model_validator(mode="after")
    def _reason_of_something(self) -> "Comparability":
        if self.reason is not None and self.unmappable is None:
            raise ValueError("a reason goes with unmappable, which says it in a sentence")
        return self

    def over(self, outer: "Comparability") -> "Comparability":
        """Returns this one, with missing fields from `outer`."""
        output: dict[str, Any] = {name: getattr(self, name) for name in Comparability.model_fields}
        return Comparability(
            **{k: v if v is not None else getattr(outer, k) for k, v in output.items()}
        )

    @property
    def judged(self) -> bool:
        """Returns whether it gets a verdict of its own."""
        blocked = self.unmappable or self.parameter or self.same_data or self.duplicate_of
        return not blocked and not (self.erratum and self.erratum.skip)
