# SPDX-License-Identifier: Apache-2.0
"""papers/<id>/plan.yaml: what a campaign will decide, written before it runs.

The plan freezes by digest what could be changed to fit a result: contrasts, margins, mapping and
judged numbers. Its own digest goes into the report, which also lists runs from before the plan.
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
"""Texts of the mapping that may be improved without a new plan. Building a system does not change
the mapping, because `match` already told how its runs are found."""
DIGITS = 16
"""Hex digits of a digest: enough to distinguish plans, few enough to print."""


class PlannedData(BaseModel):
    """What is played for one of the paper's sequences."""

    model_config = STRICT

    dataset: str
    """Its name in the experiments."""
    played: str
    """The sequence that is played if nothing beyond the repository is available."""
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
    """Runs per cell. Fewer than five decide nothing."""
    seed: int
    """Seed of its runs."""
    decides: list[str]
    """Ids of contrasts."""
    power: dict[str, float] = Field(default_factory=dict)
    """Maps a contrast to the chance that it holds with these runs if the paper's numbers are true;
    only for contrasts with printed numbers."""
    why: str = ""
    """Reason for the number of runs."""


class PlannedLater(BaseModel):
    """Contrasts that none of our systems can show yet. They are declared before a system exists
    whose results could influence them."""

    model_config = STRICT

    decides: list[str] = Field(min_length=1)
    """Ids of contrasts."""
    runs: int = Field(ge=5)
    """Fewest runs per cell."""
    power: dict[str, float] = Field(default_factory=dict)
    """As in `PlannedRuns`."""
    waits_for: str
    """What must exist first."""


class ReplacedPlan(BaseModel):
    """The previous plan. It is a note and not part of the digest."""

    model_config = STRICT

    plan: str
    """Its digest, as in the manifests of its runs."""
    why: str
    """What has changed, shown on the page: for the earlier runs the new plan is not a
    prediction."""


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
    """Files in catalog/devices/fits that these devices come from."""
    frozen: str
    """Digest of contrasts, margins, mapping and judged numbers of the paper (`frozen_digest`)."""
    data: dict[str, PlannedData]
    """Maps a name in the paper to what is played."""
    runs: list[PlannedRuns] = Field(default_factory=list)
    """Experiments, and what they decide."""
    later: list[PlannedLater] = Field(default_factory=list)
    """Contrasts that wait for a system; a later plan with runs for them must adopt these, and has
    its own digest."""
    limits: list[str] = Field(default_factory=list)
    """What the campaign cannot decide, and why."""
    replaces: ReplacedPlan | None = None
    """The plan under which runs were made before this one was written."""

    @model_validator(mode="after")
    def _decides_something(self) -> "PaperPlan":
        if not self.runs and not self.later:
            raise ValueError("a plan decides something: runs or later")
        return self

    @property
    def digest(self) -> str:
        """Returns the digest that identifies this plan in reports."""
        return _digest(_content_of(self, set(PaperPlan.model_fields) - {"replaces"}))

    def made_before(self, started_utc: datetime) -> bool:
        """Returns whether a run is older than the plan, so its result may have been known."""
        return started_utc < self.written_utc


def frozen_digest(paper: Paper) -> str:
    """Returns the digest of everything except the runs that a verdict depends on: the mapping,
    orderings, margins and judged numbers. Explanatory text is left out."""
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
    """Reads the plan of a paper; None if there is none. Raises SlambedError for an invalid file."""
    path = (folder or papers_folder()) / paper / PLAN_FILE
    if not path.exists():
        return None
    plan = read_model(PaperPlan, path)
    if plan.paper != paper:
        raise SlambedError(f"plan of '{plan.paper}', {path}, write paper: {paper}")
    return plan


def plans_of_today() -> dict[str, dict[str, str]]:
    """Maps each paper to the digests of its plan and of its current file (`frozen_digest`), for the
    manifests of new runs. A paper with unreadable files is left out, because runs do not need it;
    the lint reports it."""
    found: dict[str, dict[str, str]] = {}
    for name, path in paper_files().items():
        with suppress(SlambedError):
            if (plan := read_plan(name)) is not None:
                found[name] = {"plan": plan.digest, "frozen": frozen_digest(read_paper(path))}
    return found


def _content_of(model: BaseModel, include: set[str]) -> dict[str, Any]:
    """Returns a file's content without defaults, so that a key added to the model later changes no
    digest."""
    return model.model_dump(mode="json", include=include, exclude_defaults=True)


def _without_words(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _without_words(v) for k, v in value.items() if k not in WORDS}
    return [_without_words(part) for part in value] if isinstance(value, list) else value


def _digest(value: Any) -> str:
    return hashlib.sha256(canonical_json(value).encode()).hexdigest()[:DIGITS]
