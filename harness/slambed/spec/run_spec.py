# SPDX-License-Identifier: Apache-2.0
"""One run: everything that it needs, and the key that identifies it."""

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from numbers import Real
from pathlib import PurePath
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from slambed.spec.board import Board
from slambed.spec.device import Device
from slambed.spec.experiment import (
    DEVICE_PACE,
    HOST_PACE,
    MAX_RUN_MB,
    Pace,
    Playback,
    Tolerances,
)
from slambed.spec.faults import Fault, as_json
from slambed.spec.masks import Masks
from slambed.spec.runtime import Runtime
from slambed.spec.system import Role, Scalar

KEY_DIGITS = 16


class LinkSpec(BaseModel):
    """The link of a run: a backend, and a profile with its content."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    backend: str
    profile: str
    content: dict[str, Any]

    def meaning(self) -> dict[str, Any]:
        """Returns what identifies the link; a trace counts by its content, wherever it is
        stored."""
        return {**self.model_dump(mode="json"), "content": with_trace_names(self.content, _name)}


def with_trace_names(
    content: Any, rename: Callable[[str], str], digest: Callable[[str], str] | None = None
) -> Any:
    """Returns a profile's content with the names of its trace files replaced. `digest` computes
    what is written beside the file of a latency trace; None leaves the digests that are there."""
    if isinstance(content, list):
        return [with_trace_names(item, rename, digest) for item in content]
    if not isinstance(content, Mapping):
        return content
    found = {key: with_trace_names(value, rename, digest) for key, value in content.items()}
    if isinstance(trace := found.get("trace"), str):
        found["trace"] = rename(trace)
    elif isinstance(trace, dict) and isinstance(trace.get("file"), str):
        found["trace"] = {**trace, "file": rename(trace["file"])}
        if digest is not None:
            found["trace"]["sha256"] = digest(trace["file"])
    if isinstance(digests := found.get("rate_sha256"), dict):
        named = {rename(path): digest for path, digest in digests.items()}
        if len(named) == len(digests):  # not two files of one name
            found["rate_sha256"] = named
    return found


def _name(path: str) -> str:
    """Returns the name of a file that is given by its absolute path."""
    return PurePath(path).name if PurePath(path).is_absolute() else path


class RunSpec(BaseModel):
    """Everything that one run needs; no other setting may influence its result."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    experiment: str
    cell: str
    repetition: int
    label: str
    system: str
    variant: str
    roles: list[Role]
    channels: list[str]
    params: dict[str, Scalar]
    inputs: dict[str, str] = Field(default_factory=dict)
    """Parameter that names an input file -> SHA-256 of the file."""
    masks: Masks | None = None
    """Segmentation of the run and, for virtual runs, the mask file."""
    further_masks: list[Masks] = Field(default_factory=list)
    """Masks for the other thresholds of a system that adapts its threshold."""
    edge_inputs: list[str] = Field(default_factory=list)
    """Inputs that only the edge receives; in no run key."""
    runtime: Runtime | None = None
    """How a system with its own program is started; `software` represents it in the run key."""
    system_folder: str = ""
    """Folder of such a system; in no run key."""
    reference: str = ""
    """Path of the run that this one is compared with. It only judges the run and is in no run
    key."""
    dataset: str
    sequence_checksum: str
    playback: Playback
    device_mobile: Device
    device_edge: Device | None
    board: Board | None = None
    """The machine of the mobile node, if it is not this one."""
    profile: str | None
    link: LinkSpec | None
    faults: list[Fault] = Field(default_factory=list)
    engine: str
    pace: Pace = HOST_PACE
    """For a live run: whether stages take the host's or the device's compute times."""
    seed: int
    software: str
    host_speed: float | None = None
    """Core speed of the host that the limits of a board were derived with. None without a board,
    and where each of several hosts has its own speed: those runs emulate the board on any host."""
    max_run_mb: int = MAX_RUN_MB
    """What it may write; decides the outcome of a run that writes more."""
    tolerances: Tolerances

    def meaning(self) -> dict[str, Any]:
        """Returns what identifies the run. Experiment, cell and label only name it; tolerances
        only judge it afterwards."""
        # A run without these options keeps the key it had before they were introduced.
        further: dict[str, Any] = {"faults": as_json(self.faults)} if self.faults else {}
        if self.host_speed is not None:
            further["host_speed"] = self.host_speed
        if self.board is not None:
            further["board"] = self.board.meaning()
        if self.masks is not None:
            further["masks"] = self.masks.meaning()
        if self.paced:
            further["pace"] = self.pace
        if self.max_run_mb != MAX_RUN_MB:
            further["max_run_mb"] = self.max_run_mb
        if self.further_masks:
            further["further_masks"] = [masks.meaning() for masks in self.further_masks]
        return further | {
            "system": self.system,
            "variant": self.variant,
            # A file counts by its content, wherever it is stored.
            "params": self.params | self.inputs,
            "sequence": self.sequence_checksum,
            "playback": self.playback.meaning(),
            "device_mobile": self.device_mobile.meaning(self.engine, self.paced),
            "device_edge": self.device_edge.meaning(self.engine, self.paced)
            if self.device_edge
            else None,
            "profile": self.profile,
            "link": self.link.meaning() if self.link else None,
            "engine": self.engine,
            "seed": self.seed,
            "repetition": self.repetition,
            "software": self.software,
        }

    @property
    def paced(self) -> bool:
        """True for a live run at the pace of its devices."""
        return self.pace == DEVICE_PACE

    @property
    def run_name(self) -> str:
        """Cell and repetition number, counted from 1."""
        return run_name(self.cell, self.repetition)

    @property
    def run_key(self) -> str:
        """Hash of `meaning()`, which also names the run's folder."""
        return hashlib.sha256(canonical_json(self.meaning()).encode()).hexdigest()[:KEY_DIGITS]


def run_name(cell: object, repetition: object) -> str:
    """Returns the name of a run in tables and messages: `edgeslam:static/room/ramp #1`."""
    if not isinstance(repetition, Real) or not math.isfinite(repetition):
        return str(cell)  # the repetition was not recorded
    return f"{cell} #{float(repetition) + 1:.0f}"


def canonical_json(value: object) -> str:
    """Returns the unique JSON text of a value: sorted keys, no spaces, no NaN."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
