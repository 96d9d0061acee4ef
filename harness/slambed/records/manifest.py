# SPDX-License-Identifier: Apache-2.0
"""manifest.json: under which circumstances a run was made, and how it ended."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, model_validator

from slambed.files.json_file import Record
from slambed.link.facts import LinkFacts
from slambed.older_names import manifest_of_today
from slambed.records.board import BoardFacts
from slambed.records.kept_spec import KeptSpec
from slambed.sampling.record import NodeLimits, SidecarUse, Throttling
from slambed.spec.run_spec import RunSpec

FILE = "manifest.json"


class PlanDigests(Record):
    """A paper's plan, or an inference's, as the campaign began."""

    plan: str | None = None
    """SHA-256 of the registered plan."""
    frozen: str | None = None
    """SHA-256 of what its file said."""
    commit: str | None = None
    """Of an inference: that held the plan and its experiments as they were; null: none did."""


class RunHost(Record):
    """One of several hosts that a campaign had, or the board of a mobile node."""

    name: str | None = None
    """In the file of hosts."""
    labels: list[str] | None = None
    """There."""
    cpus: list[int] | None = None
    """That runs might use."""
    speed: float | None = None
    """Of one of its cores as the campaign began; 1 is a core of the reference host."""
    speed_measured_utc: str | None = None
    """ISO 8601; null: never, it was taken for 1."""


class EngineFacts(Record):
    """What an engine says about itself."""

    image: str | None = None
    """Tag of the image."""
    image_id: str | None = None
    """Null without an image."""


class Manifest(Record):
    """All facts about one run that are not measurements, in the order of the file."""

    run_key: str | None = None
    """What names the run."""
    experiment: str | None = None
    """That had it executed first."""
    cell: str | None = None
    """System x dataset x link profile."""
    repetition: int | None = None
    """Counted from 0."""
    # What is read is never refused for what it lacks; what is written is whole.
    spec: Annotated[KeptSpec | RunSpec | None, Field(union_mode="left_to_right")] = None
    """The whole RunSpec."""
    outcome: str | None = None
    """`completed`, `died`, `timed_out` (a live run by wall clock, a virtual one by CPU time),
    `refused` (its input)."""
    outcome_reason: str | None = None
    """Why it did not complete."""
    invalid_reasons: list[str] | None = None
    """Why the circumstances were not as asked."""
    limits: dict[str, NodeLimits] | None = None
    """Of each node of a live run."""
    throttling: dict[str, Throttling] | None = None
    """Of each node of a live run."""
    link: LinkFacts | None = None
    """Null without a link."""
    board: BoardFacts | None = None
    """Only of a run whose mobile node was on another machine."""
    sidecar: SidecarUse | None = None
    """Null in a virtual run."""
    commit: str | None = None
    """Of the checkout; null outside of git."""
    dirty: bool | None = None
    """Whether tracked files differed from it."""
    tree: str | None = None
    """The folder of that checkout: whose code executed the run."""
    image_id: str | None = None
    """Null without Docker."""
    command: list[str] | str | None = None
    """As the user gave it."""
    image: str | None = None
    """Only with Docker: its tag."""
    sequence_checksum: str | None = None
    """Of the prepared sequence."""
    seed: int | None = None
    """Of everything drawn in the run."""
    kernel: str | None = None
    """Its release."""
    cpu_model: str | None = None
    """As the kernel names it."""
    cores: int | None = None
    """Of the host."""
    load_1min: float | None = None
    """Of the host, as the run began."""
    host: RunHost | None = None
    """Only of a campaign with several hosts: the one that executed the run; of a run with a board:
    the board."""
    started_utc: str | None = None
    """ISO 8601."""
    versions: dict[str, str | None] | None = None
    """slambed, Python and the packages that compute figures."""
    attempt: int | None = None
    """Counted from 1."""
    frames_offered: int | None = None
    """By the plan of playback; null for what is no prepared sequence."""
    warnings: list[str] | None = None
    """What was wrong with the raw files."""
    results_sha256: str | None = None
    """Over what was measured: summary, tables, trajectories; equal for equal virtual runs."""
    plans: dict[str, PlanDigests] | None = None
    """Paper (`inference/<id>` of an inference) -> its plan as the campaign began; empty without."""

    @property
    def kept(self) -> KeptSpec:
        """The spec, as far as it is read afterwards."""
        return self.spec if isinstance(self.spec, KeptSpec) else KeptSpec.of(self.spec or {})

    @model_validator(mode="before")
    @classmethod
    def _with_names_of_today(cls, content: Any) -> Any:
        return manifest_of_today(content) if isinstance(content, Mapping) else content
