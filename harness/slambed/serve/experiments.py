# SPDX-License-Identifier: Apache-2.0
"""Which experiments a results folder has, and how far each is."""

import time
from dataclasses import dataclass
from pathlib import Path

from slambed.campaign.campaign_state import CampaignState, state_of, title_of
from slambed.campaign.progress import duration
from slambed.campaign.run_experiment import RESERVED
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
    """Its last one, as it was when the ledger was last written."""


def names_of(results: Path) -> list[str]:
    """Experiments that were begun at least, by name."""
    try:
        folders = sorted(path for path in results.iterdir() if path.is_dir())
    except OSError:
        return []
    return [p.name for p in folders if is_experiment(p)]


def is_experiment(folder: Path) -> bool:
    """Whether a folder of results is an experiment's, whole or broken."""
    if not PART.match(folder.name) or folder.name in RESERVED:
        return False
    return (folder / "experiment.json").is_file() or (folder / "runs").is_dir()


def listed(results: Path, name: str) -> ExperimentEntry:
    """What the list says of an experiment; it reads a small file per run."""
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
    """A campaign in words."""
    if state is None:
        return "not known"
    if state.alive:
        left = "" if state.left_s is None else f", about {duration(state.left_s)} left"
        return f"running: {state.done} of {state.asked} runs{left}"
    if state.interrupted:
        return "interrupted"
    return "ended" if state.ended else "broken off: its process is gone"
