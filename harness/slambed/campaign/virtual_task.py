# SPDX-License-Identifier: Apache-2.0
"""One virtual run as it is passed to another process on this host or in a cluster."""

import threading
from dataclasses import dataclass
from pathlib import Path

from slambed.campaign.raw_folder import add_summary, prepare_raw
from slambed.engines.virtual import VirtualRun
from slambed.metrics.summary import Summary
from slambed.records.manifest import EngineFacts
from slambed.spec.run_spec import RunSpec


@dataclass(frozen=True)
class VirtualTask:
    """Everything that a process needs to execute a run."""

    spec: RunSpec
    raw: Path
    sequence: Path
    played_s: float
    program: Path
    features: Path | None
    command: list[str]
    """Command line of the user; differs from sys.argv in a worker process."""
    attempt: int = 1

    def execute(self) -> Summary:
        """Simulates in the calling thread, then returns the summary."""
        run = VirtualRun(
            self.spec, self.sequence, self.played_s, self.raw, self.program, self.features
        )
        engine = EngineFacts(image_id=None)
        never = threading.Event()  # never set: to stop the run, the process is killed
        start = prepare_raw(self.spec, self.raw)
        result = run.execute(never)
        return add_summary(
            self.spec, self.raw, self.sequence, engine, self.command, start, result, self.attempt
        )
