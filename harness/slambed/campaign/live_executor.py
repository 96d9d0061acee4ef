# SPDX-License-Identifier: Apache-2.0
"""Executor of live runs on this host."""

import sys
import threading
from dataclasses import dataclass, field
from pathlib import Path

from slambed.campaign.executors import Played
from slambed.campaign.raw_folder import add_summary, prepare_raw, recording_of
from slambed.engines.base import Engine
from slambed.engines.docker_errors import daemon_failures
from slambed.engines.live_run import LinkOpener, LiveRun
from slambed.errors import SlambedError
from slambed.metrics.summary import Summary
from slambed.spec.host_speed import load_host_speed
from slambed.spec.run_spec import RunSpec


@dataclass
class LiveExecutor:
    """Runs two nodes and a link on this host, one run at a time."""

    engine: Engine
    open_link: LinkOpener
    played: Played
    jobs: int = 1
    command: list[str] = field(default_factory=lambda: sys.argv)
    """Command line of the user; differs from sys.argv in a worker process."""

    def execute(self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1) -> Summary:
        """Executes the run in the calling thread. Raises PassingError if the Docker daemon or a
        sidecar fails."""
        sequence, played_s = self.played[spec.dataset]
        host = load_host_speed()
        if spec.host_speed not in (None, host.speed):
            raise SlambedError("the host was calibrated since the campaign began; start it again")
        reads = spec.runtime is not None and spec.runtime.reads is not None
        frames = recording_of(spec, sequence).folder() if reads else None
        run = LiveRun(
            spec, self.engine, sequence, played_s, raw, self.open_link, stop, host, frames
        )
        with daemon_failures("keep the nodes of a run"):
            engine = self.engine.describe()
            start = prepare_raw(spec, raw)
            result = run.execute()
            return add_summary(spec, raw, sequence, engine, self.command, start, result, attempt)

    def close(self) -> None:
        """Does nothing: nothing outlives a live run."""
