# SPDX-License-Identifier: Apache-2.0
"""What executes the runs of a campaign."""

import threading
from pathlib import Path
from typing import Protocol

from slambed.metrics.summary import Summary
from slambed.spec.run_spec import RunSpec

Played = dict[str, tuple[Path, float]]
"""Sequence id -> (prepared folder, played seconds)."""


class Executor(Protocol):
    """Turns RunSpecs into raw folders that are whole but for their place."""

    @property
    def jobs(self) -> int:
        """How many runs it executes at once; `execute` is called from as many threads."""

    def execute(self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1) -> Summary:
        """Fills the folder; returns the summary. InterruptedRunError soon after `stop` is set;
        PassingError when another attempt may do."""

    def close(self) -> None:
        """Ends whatever it started."""


class NoRuns:
    """Of a campaign that has nothing to execute: it takes no host and joins no cluster."""

    jobs = 1

    def execute(self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1) -> Summary:
        """There is none."""
        raise NotImplementedError

    def close(self) -> None:
        """Nothing was started."""
