# SPDX-License-Identifier: Apache-2.0
"""Command line options of `slambed run`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from slambed.campaign.runner import DEFAULT_RETRIES

if TYPE_CHECKING:
    from slambed.campaign.overall import Overall


@dataclass
class Options:
    """Options that override or extend the experiment file."""

    runs: int | str | None = None
    engine: str | None = None
    results: Path = Path("results")
    wait: bool = False
    """Waits for the end of another campaign on this host."""
    jobs: int | None = None
    """Number of concurrent virtual runs; default: all CPUs."""
    scheduler: str | None = None
    """Address of a Dask scheduler whose workers execute the virtual runs."""
    slurm: bool = False
    """Virtual runs as `jobs` Slurm jobs."""
    hosts: Path | None = None
    """File of the hosts that execute the live runs; without it, this host does."""
    on: list[str] = field(default_factory=list)
    """Names or labels that select hosts of the file."""
    retries: int = DEFAULT_RETRIES
    """Maximum number of retries of an invalid run."""
    quiet_within_min: float = 0.0
    """How long to wait for the host to become quiet before live runs."""
    settings: list[str] = field(default_factory=list)
    """`key=value` pairs that override the experiment file."""
    only: list[str] = field(default_factory=list)
    """Selections of cells to execute, patterns included; empty: all."""
    force: list[str] = field(default_factory=list)
    """Selections of cells whose runs are executed again even if they exist."""
    keep_going: bool = False
    """Continues the campaign after runs without a result."""
    dry_run: bool = False
    """Shows what would be executed without executing anything."""
    part: tuple[int, int] | None = None
    """(i, n): only the runs of part i of n, where several machines share a campaign."""
    keys: frozenset[str] | None = None
    """Keys of the runs to execute; None: all."""
    datasets: frozenset[str] | None = None
    """Names of the datasets that virtual runs are planned on; None: all of the experiment."""
    overall: "Overall | None" = None
    """Account of the campaign that this experiment is part of."""
    plans: dict[str, dict[str, str]] = field(default_factory=dict)
    """Current plans of the papers, for the manifests."""
