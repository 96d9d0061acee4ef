# SPDX-License-Identifier: Apache-2.0
"""What has to be known about a published number before it is judged at all."""

from typing import Any

from pydantic import model_validator

from slambed.papers.published.base import Number, Strict


class Erratum(Strict):
    """The paper contradicts itself here. Exactly one of `judge_as` and `skip`."""

    why: str
    """What contradicts what."""
    judge_as: Number | str | None = None
    """What is judged instead: a number, or the id of a cell or claim."""
    skip: bool = False
    """Nothing can be judged."""

    @model_validator(mode="after")
    def _one_of_them(self) -> "Erratum":
        if (self.judge_as is None) != self.skip:
            raise ValueError("an erratum says either judge_as or skip")
        return self


class Comparability(Strict):
    """Said of a table, a row, one cell or a claim; what is said of the smaller part wins."""

    unmappable: str | None = None
    """Why no number of ours stands for it. With none, the lint wants a mapping that resolves."""
    parameter: str | None = None
    """A setting or a property of the data, not a result: where our configuration has it."""
    same_data: str | None = None
    """From which printed input ours is computed, so that agreement is no evidence."""
    duplicate_of: str | None = None
    """Id of the cell or claim that is counted; this one is shown with its verdict."""
    erratum: Erratum | None = None
    """Where the paper contradicts itself."""
    read_as: str | None = None
    """How we read it where the paper leaves it open, in a sentence."""

    def over(self, outer: "Comparability") -> "Comparability":
        """This one, and where it says nothing, what `outer` says."""
        output: dict[str, Any] = {name: getattr(self, name) for name in Comparability.model_fields}
        return Comparability(
            **{k: v if v is not None else getattr(outer, k) for k, v in output.items()}
        )

    @property
    def judged(self) -> bool:
        """Whether a verdict of its own is due."""
        blocked = self.unmappable or self.parameter or self.same_data or self.duplicate_of
        return not blocked and not (self.erratum and self.erratum.skip)
