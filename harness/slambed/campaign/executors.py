# SPDX-License-Identifier: Apache-2.0
"""Interface of the executors of a campaign's runs."""

import threading
from pathlib import Path
from typing import Protocol

from slambed.metrics.summary import Summary
from slambed.spec.run_spec import RunSpec

Played = dict[str, tuple[Path, float]]
"""Sequence id -> (prepared folder, played seconds)."""


class Executor(Protocol):
    """Turns RunSpecs into complete raw folders."""

    @property
    def jobs(self) -> int:
        """Number of concurrent runs; `execute` is called from as many threads."""

    def execute(self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1) -> Summary:
        """Fills the folder and returns the summary. Raises InterruptedRunError soon after `stop`
        is set, and PassingError if another attempt may succeed."""

    def close(self) -> None:
        """Ends everything that the executor started."""


class NoRuns:
    """Executor of a campaign without pending runs: it takes no host and joins no cluster."""

    jobs = 1

    def execute(self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1) -> Summary:
        """Never called."""
        raise NotImplementedError

    def close(self) -> None:
        """Does nothing."""
