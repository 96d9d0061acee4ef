# SPDX-License-Identifier: Apache-2.0
"""Who makes the runs of a campaign: this process live, or this process in virtual time."""

import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from slambed.campaign.make import make_run
from slambed.engines.base import Engine
from slambed.engines.live_run import LinkOpener, LiveRun
from slambed.engines.virtual import VirtualRun
from slambed.spec.host_speed import load_host_speed
from slambed.spec.matrix import RunSpec

Played = dict[str, tuple[Path, float]]
"""Sequence id -> (prepared folder, played seconds)."""


class Maker(Protocol):
    """Turns RunSpecs into raw folders that are whole but for their place."""

    jobs: int
    """How many runs it makes at once; `make` is called from as many threads."""

    def make(self, spec: RunSpec, raw: Path, stop: threading.Event) -> dict[str, Any]:
        """Fills the folder; returns the summary. InterruptedRunError soon after `stop` is set."""

    def close(self) -> None:
        """Ends whatever it started."""


@dataclass
class LiveMaker:
    """Two nodes and a link on this host, one run at a time."""

    engine: Engine
    open_link: LinkOpener
    played: Played
    jobs: int = 1

    def make(self, spec: RunSpec, raw: Path, stop: threading.Event) -> dict[str, Any]:
        """In the calling thread."""
        sequence, played_s = self.played[spec.dataset]
        host = load_host_speed()
        run = LiveRun(spec, self.engine, sequence, played_s, raw, self.open_link, stop, host)
        return make_run(spec, raw, sequence, self.engine.describe(), run.execute)

    def close(self) -> None:
        """Nothing outlives a live run."""


@dataclass
class VirtualMaker:
    """One virtual run in the calling thread; what a worker process does."""

    played: Played
    program: Path
    features: Path | None
    command: list[str]
    """What the user called: this process may be another's worker."""
    jobs: int = 1

    def make(self, spec: RunSpec, raw: Path, stop: threading.Event) -> dict[str, Any]:
        """Simulates, then summarises."""
        sequence, played_s = self.played[spec.dataset]
        run = VirtualRun(spec, sequence, played_s, raw, self.program, self.features)
        engine = {"image_id": None, "command": self.command}
        return make_run(spec, raw, sequence, engine, lambda: run.execute(stop))

    def close(self) -> None:
        """Nothing outlives a virtual run."""
