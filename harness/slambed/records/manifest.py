# SPDX-License-Identifier: Apache-2.0
"""manifest.json: the circumstances of a run, and how it ended."""

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
    """A paper's plan, or an inference plan, at the start of the campaign."""

    plan: str | None = None
    """SHA-256 of the registered plan."""
    frozen: str | None = None
    """SHA-256 of the content of its file."""
    commit: str | None = None
    """For an inference: the commit that contains the unchanged plan and its experiments; null:
    none does."""


class RunHost(Record):
    """The host of a campaign with several hosts that executed the run, or the board of a mobile
    node."""

    name: str | None = None
    """Name in the file of hosts."""
    labels: list[str] | None = None
    """Labels in the file of hosts."""
    cpus: list[int] | None = None
    """CPUs that runs were allowed to use."""
    speed: float | None = None
    """Speed of one of its cores at the start of the campaign; 1 is a core of the reference host."""
    speed_measured_utc: str | None = None
    """ISO 8601; null: not measured, 1 was assumed."""


class EngineFacts(Record):
    """Facts that an engine reports about itself."""

    image: str | None = None
    """Tag of the image."""
    image_id: str | None = None
    """Id of the image; null without an image."""


class Manifest(Record):
    """All facts about one run that are not measurements, in the order of the file."""

    run_key: str | None = None
    """Key that identifies the run."""
    experiment: str | None = None
    """Experiment that first executed it."""
    cell: str | None = None
    """System x dataset x link profile."""
    repetition: int | None = None
    """Counted from 0."""
    # Missing fields are accepted when a file is read; a written file is complete.
    spec: Annotated[KeptSpec | RunSpec | None, Field(union_mode="left_to_right")] = None
    """The whole RunSpec."""
    outcome: str | None = None
    """`completed`, `died`, `timed_out` (wall clock of a live run, CPU or virtual time of a virtual
    one), or `refused` (its input)."""
    outcome_reason: str | None = None
    """Why the run did not complete."""
    invalid_reasons: list[str] | None = None
    """Why the circumstances were not as configured."""
    limits: dict[str, NodeLimits] | None = None
    """Limits of each node of a live run."""
    throttling: dict[str, Throttling] | None = None
    """Throttling of each node of a live run."""
    link: LinkFacts | None = None
    """Null without a link."""
    board: BoardFacts | None = None
    """Only for a run whose mobile node was on another machine."""
    sidecar: SidecarUse | None = None
    """Null in a virtual run."""
    commit: str | None = None
    """Commit of the checkout, or from which an installed package was built; null if unknown."""
    dirty: bool | None = None
    """Whether tracked files differed from that commit."""
    tree: str | None = None
    """Folder of the checkout whose code executed the run."""
    image_id: str | None = None
    """Id of the image; null without Docker."""
    command: list[str] | str | None = None
    """Command line of the user."""
    image: str | None = None
    """Tag of the image; only with Docker."""
    sequence_checksum: str | None = None
    """Checksum of the prepared sequence."""
    seed: int | None = None
    """Seed of all random numbers in the run."""
    kernel: str | None = None
    """Release of the kernel."""
    cpu_model: str | None = None
    """CPU model as the kernel reports it."""
    cores: int | None = None
    """Number of cores of the host."""
    load_1min: float | None = None
    """Load average of the host at the start of the run."""
    host: RunHost | None = None
    """Host that executed the run, only for a campaign with several hosts; for a run with a
    board: the board."""
    started_utc: str | None = None
    """ISO 8601."""
    versions: dict[str, str | None] | None = None
    """Versions of slambed, Python and the packages that compute metrics."""
    python_packages: dict[str, str] | None = None
    """Package -> version of a system with Python packages; null for others."""
    attempt: int | None = None
    """Number of the attempt, counted from 1."""
    frames_offered: int | None = None
    """Number of frames in the playback plan; null for an input that is not a prepared sequence."""
    warnings: list[str] | None = None
    """Problems found in the raw files."""
    results_sha256: str | None = None
    """SHA-256 over summary, tables, trajectories and map; equal for identical virtual runs."""
    plans: dict[str, PlanDigests] | None = None
    """Paper (or `inference/<id>`) -> its plan at the start of the campaign; empty without plans."""

    @property
    def kept(self) -> KeptSpec:
        """The spec, reduced to the fields that are read back."""
        return self.spec if isinstance(self.spec, KeptSpec) else KeptSpec.of(self.spec or {})

    @model_validator(mode="before")
    @classmethod
    def _with_names_of_today(cls, content: Any) -> Any:
        return manifest_of_today(content) if isinstance(content, Mapping) else content
