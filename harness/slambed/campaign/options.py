# SPDX-License-Identifier: Apache-2.0
"""What the command line of `slambed run` may say of a campaign."""

from dataclasses import dataclass, field
from pathlib import Path

from slambed.campaign.runner import DEFAULT_RETRIES


@dataclass
class Options:
    """What the command line may override."""

    runs: int | str | None = None
    engine: str | None = None
    results: Path = Path("results")
    wait: bool = False
    """Wait for another campaign on this host to end."""
    jobs: int | None = None
    """Virtual runs at a time; all CPUs when not given."""
    scheduler: str | None = None
    """Address of a Dask scheduler whose workers execute the virtual runs."""
    slurm: bool = False
    """Virtual runs as `jobs` Slurm jobs."""
    hosts: Path | None = None
    """File of the hosts that execute the live runs; this one where there is none."""
    on: list[str] = field(default_factory=list)
    """Names or labels of the hosts to take of them."""
    retries: int = DEFAULT_RETRIES
    """Further attempts of an invalid run."""
    quiet_within_min: float = 0.0
    """How long to wait for the host to become quiet before live runs."""
    settings: list[str] = field(default_factory=list)
    """`key=value`, instead of what the experiment's file says."""
    only: list[str] = field(default_factory=list)
    """Cells to execute, patterns included; all where none is named."""
    force: list[str] = field(default_factory=list)
    """Cells, patterns included, whose runs are executed again although they are there."""
    keep_going: bool = False
    """Runs that have to be given up do not end the campaign."""
    dry_run: bool = False
    """Show what would be executed, and execute nothing."""
    plans: dict[str, dict[str, str]] = field(default_factory=dict)
    """The papers' plans of this moment, for the manifests of what is executed."""
