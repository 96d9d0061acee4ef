# SPDX-License-Identifier: Apache-2.0
"""Lists the experiments of a results folder and their progress."""

import time
from dataclasses import dataclass
from pathlib import Path

from slambed.campaign.campaign_state import CampaignState, state_of, title_of
from slambed.campaign.plan import RESERVED
from slambed.campaign.progress import duration
from slambed.files.json_file import read_object
from slambed.metrics.summary import Summary
from slambed.serve.guard import PART


@dataclass(frozen=True)
class ExperimentEntry:
    """One experiment in the list."""

    name: str
    title: str
    planned: int | None
    there: int
    valid: int
    changed_s: float
    """Unix time of the last change."""
    campaign: CampaignState | None
    """Its last campaign, as of the ledger's last entry."""


def names_of(results: Path) -> list[str]:
    """Returns the names of all experiments, sorted."""
    try:
        folders = sorted(path for path in results.iterdir() if path.is_dir())
    except OSError:
        return []
    return [p.name for p in folders if is_experiment(p)]


def is_experiment(folder: Path) -> bool:
    """Returns whether a folder of results belongs to an experiment, even a damaged one."""
    if not PART.match(folder.name) or folder.name in RESERVED:
        return False
    try:
        return (folder / "experiment.json").is_file() or (folder / "runs").is_dir()
    except OSError:  # a name that is too long
        return False


def listed(results: Path, name: str) -> ExperimentEntry:
    """Returns the entry of an experiment; it reads a small file per run."""
    folder = results / name
    planned = (read_object(folder / "experiment.json") or {}).get("runs")
    summaries = [Summary.read(path) for path in folder.glob("runs/*/summary.json")]
    there = [summary for summary in summaries if summary]
    return ExperimentEntry(
        name=name,
        title=title_of(folder),
        planned=len(planned) if isinstance(planned, list) else None,
        there=len(there),
        valid=sum(summary.valid for summary in there),
        changed_s=max(
            (p.stat().st_mtime for p in (folder, *folder.glob("ledger.jsonl"))), default=0
        ),
        campaign=state_of(folder, time.time()),
    )


def status_of(state: CampaignState | None) -> str:
    if state is None:
        return "not known"
    if state.alive:
        left = "" if state.left_s is None else f", about {duration(state.left_s)} left"
        return f"running: {state.done} of {state.asked} runs{left}"
    if state.interrupted:
        return "interrupted"
    return "ended" if state.ended else "broken off: its process is gone"
