# SPDX-License-Identifier: Apache-2.0
"""One run: everything that it needs, and the key that hashes what it means."""

import hashlib
import json
import math
from numbers import Real
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from slambed.spec.board import Board
from slambed.spec.device import Device
from slambed.spec.experiment import DEVICE_PACE, HOST_PACE, Pace, Playback, Tolerances
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


class RunSpec(BaseModel):
    """Everything one run needs; nothing else may influence its result."""

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
    """What is segmented, and for virtual runs the file of the masks."""
    further_masks: list[Masks] = Field(default_factory=list)
    """The same with other thresholds, of a system that changes its threshold."""
    edge_inputs: list[str] = Field(default_factory=list)
    """Those that only the edge is given; in no key."""
    runtime: Runtime | None = None
    """How a system that is a program of its own is started; `software` stands for it in the key."""
    system_folder: str = ""
    """Where such a system lies; in no key."""
    reference: str = ""
    """Path that this run's is compared with: it judges the run and is in no key."""
    dataset: str
    sequence_checksum: str
    playback: Playback
    device_mobile: Device
    device_edge: Device | None
    board: Board | None = None
    """The machine that executes the mobile node, where it is not this one."""
    profile: str | None
    link: LinkSpec | None
    faults: list[Fault] = Field(default_factory=list)
    engine: str
    pace: Pace = HOST_PACE
    """Of a live run: whose compute times its stages take."""
    seed: int
    software: str
    host_speed: float | None = None
    """Speed of the host's cores that the limits of a board were derived with; None without one, and
    where each of several hosts has its own: those runs mean the board, on whatever host."""
    tolerances: Tolerances

    def meaning(self) -> dict[str, Any]:
        """What the run means. Experiment, cell and label are only names for it, tolerances judge
        it afterwards."""
        # A run without these keeps the key it had before there were any.
        further: dict[str, Any] = {"faults": as_json(self.faults)} if self.faults else {}
        if self.host_speed is not None:
            further["host_speed"] = self.host_speed
        if self.board is not None:
            further["board"] = self.board.meaning()
        if self.masks is not None:
            further["masks"] = self.masks.meaning()
        if self.paced:
            further["pace"] = self.pace
        if self.further_masks:
            further["further_masks"] = [masks.meaning() for masks in self.further_masks]
        return further | {
            "system": self.system,
            "variant": self.variant,
            # A file is its content, wherever it lies.
            "params": self.params | self.inputs,
            "sequence": self.sequence_checksum,
            "playback": self.playback.meaning(),
            "device_mobile": self.device_mobile.meaning(self.engine, self.paced),
            "device_edge": self.device_edge.meaning(self.engine, self.paced)
            if self.device_edge
            else None,
            "profile": self.profile,
            "link": self.link.model_dump(mode="json") if self.link else None,
            "engine": self.engine,
            "seed": self.seed,
            "repetition": self.repetition,
            "software": self.software,
        }

    @property
    def paced(self) -> bool:
        """A live run at its devices' pace."""
        return self.pace == DEVICE_PACE

    @property
    def run_name(self) -> str:
        """Cell and number of the repetition, from 1."""
        return run_name(self.cell, self.repetition)

    @property
    def run_key(self) -> str:
        """Hash of `meaning()`: the name of the run's folder."""
        return hashlib.sha256(canonical_json(self.meaning()).encode()).hexdigest()[:KEY_DIGITS]


def run_name(cell: object, repetition: object) -> str:
    """What a run is called where people read it: `edgeslam:static/room/ramp #1`."""
    if not isinstance(repetition, Real) or not math.isfinite(repetition):
        return str(cell)  # nobody wrote down which one
    return f"{cell} #{float(repetition) + 1:.0f}"


def canonical_json(value: object) -> str:
    """One spelling per value: sorted keys, no spaces, no NaN."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
