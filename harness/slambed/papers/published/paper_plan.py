# SPDX-License-Identifier: Apache-2.0
"""papers/<id>/plan.yaml: what a campaign will decide, written before it is run.

The plan freezes what could be bent to fit a result (contrasts, margins, mapping) by their digest,
and its own digest goes into the report. Runs from before it are reported.
"""

import hashlib
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from pydantic import AwareDatetime, BaseModel, Field, model_validator

from slambed.errors import SlambedError
from slambed.files.yaml_source import read_model
from slambed.papers.published.base import STRICT
from slambed.papers.published.cells import cells_of
from slambed.papers.published.paper import Paper
from slambed.papers.published.reading import PLAN_FILE, paper_files, papers_folder, read_paper
from slambed.spec.run_spec import canonical_json
from slambed.spec.system import Role

WORDS = {"label", "note", "read_as", "not_built"}
"""Texts of the mapping that may be bettered without another plan. That a system is built now is no
other mapping: `match` has said before how its runs are found."""
DIGITS = 16
"""Hex digits of a digest: enough to distinguish plans, few enough to print."""


class PlannedData(BaseModel):
    """What is played where the paper has one of its sequences."""

    model_config = STRICT

    dataset: str
    """As the experiments name it."""
    played: str
    """What that is where only the clone is there."""
    stand_in: bool
    """Whether it only stands in for the paper's sequence."""
    why: str
    """Reason for the choice."""


class PlannedRuns(BaseModel):
    """One experiment, and what it decides."""

    model_config = STRICT

    experiment: str
    """Name of the experiment."""
    runs: int = Field(ge=5)
    """Per cell. Fewer than five decide nothing."""
    seed: int
    """Seed of its runs."""
    decides: list[str]
    """Ids of contrasts."""
    power: dict[str, float] = Field(default_factory=dict)
    """Contrast -> chance that it holds with these runs if the paper's numbers are true; for those
    that the paper prints numbers of."""
    why: str = ""
    """Reason for the number of runs."""


class PlannedLater(BaseModel):
    """Contrasts that nothing of ours can show yet, declared all the same: before there is a system
    whose results could bend them."""

    model_config = STRICT

    decides: list[str] = Field(min_length=1)
    """Ids of contrasts."""
    runs: int = Field(ge=5)
    """Per cell, at least."""
    power: dict[str, float] = Field(default_factory=dict)
    """As of `PlannedRuns`."""
    waits_for: str
    """What has to be there first."""


class ReplacedPlan(BaseModel):
    """The plan that stood there before. Words about it, which no digest is made of."""

    model_config = STRICT

    plan: str
    """Its digest, as the runs that were made under it keep it."""
    why: str
    """What is another now, for the page: of these runs it is no prediction any more."""


class PaperPlan(BaseModel):
    """One file papers/<id>/plan.yaml."""

    model_config = STRICT

    paper: str
    """Folder in papers/."""
    written_utc: AwareDatetime
    """When it was written; runs that began before are reported."""
    engine: Literal["virtual", "live"]
    """What executes the runs."""
    devices: dict[Role, str]
    """Role -> name of a device."""
    fits: list[str]
    """Files of catalog/devices/fits that these devices come from."""
    frozen: str
    """Digest of contrasts, margins and mapping of the paper (`frozen_digest`)."""
    data: dict[str, PlannedData]
    """Name in the paper -> what is played."""
    runs: list[PlannedRuns] = Field(default_factory=list)
    """Experiments, and what they decide."""
    later: list[PlannedLater] = Field(default_factory=list)
    """What a plan with runs for them will have to take over; that one has a digest of its own."""
    limits: list[str] = Field(default_factory=list)
    """What it cannot decide, and why."""
    replaces: ReplacedPlan | None = None
    """Where runs were made under another plan before this one was written."""

    @model_validator(mode="after")
    def _decides_something(self) -> "PaperPlan":
        if not self.runs and not self.later:
            raise ValueError("a plan decides something: runs or later")
        return self

    @property
    def digest(self) -> str:
        """Names this plan in reports."""
        return _digest(_content_of(self, set(PaperPlan.model_fields) - {"replaces"}))

    def made_before(self, started_utc: datetime) -> bool:
        """Whether a run is older than the plan, and so was perhaps known when it was written."""
        return started_utc < self.written_utc


def frozen_digest(paper: Paper) -> str:
    """Digest of all that a verdict depends on but the runs: what is compared with what, which
    orderings, within which margins. Words about them are left out."""
    parts = _content_of(paper, {"systems", "datasets", "conditions", "metrics", "margins"})
    shape = {"id", "kind", "cells", "direction", "basis"}
    parts["contrasts"] = [_content_of(item, shape) for item in paper.contrasts]
    parts["cells"] = {
        name: [
            cell.value,
            cell.spread,
            cell.metric,
            cell.system,
            cell.conditions,
            cell.runs,
            _content_of(cell.comparability, {"duplicate_of", "erratum"}),
            _content_of(cell.claim, {"op", "quantity", "value"}) if cell.claim else None,
        ]
        for name, cell in cells_of(paper).items()
        if cell.comparability.judged
    }
    return _digest(_without_words(parts))


def read_plan(paper: str, folder: Path | None = None) -> PaperPlan | None:
    """The plan of a paper; None where none was written. Raises SlambedError on a wrong file."""
    path = (folder or papers_folder()) / paper / PLAN_FILE
    if not path.exists():
        return None
    plan = read_model(PaperPlan, path)
    if plan.paper != paper:
        raise SlambedError(f"plan of '{plan.paper}', {path}, write paper: {paper}")
    return plan


def plans_of_today() -> dict[str, dict[str, str]]:
    """Paper -> digests of its plan, and of what the paper's file says now (`frozen_digest`): what a
    run of this moment is made under. A paper whose files cannot be read is left out, for a run
    needs none; the lint reports what is wrong with it."""
    found: dict[str, dict[str, str]] = {}
    for name, path in paper_files().items():
        with suppress(SlambedError):
            if (plan := read_plan(name)) is not None:
                found[name] = {"plan": plan.digest, "frozen": frozen_digest(read_paper(path))}
    return found


def _content_of(model: BaseModel, include: set[str]) -> dict[str, Any]:
    """What a file says; a key that models get later, and no file has, changes no digest."""
    return model.model_dump(mode="json", include=include, exclude_defaults=True)


def _without_words(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _without_words(v) for k, v in value.items() if k not in WORDS}
    return [_without_words(part) for part in value] if isinstance(value, list) else value


def _digest(value: Any) -> str:
    return hashlib.sha256(canonical_json(value).encode()).hexdigest()[:DIGITS]
