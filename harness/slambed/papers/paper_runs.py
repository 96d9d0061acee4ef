# SPDX-License-Identifier: Apache-2.0
"""Finds the experiments behind a paper's page."""

from pathlib import Path

from slambed.errors import SlambedError
from slambed.files.yaml_source import load_yaml
from slambed.native import repository_root
from slambed.papers.published import Paper


def experiments_of(papers: list[Paper], folder: Path | None = None) -> list[str]:
    """Returns the experiments whose `reproduces` names something of these papers, or that are
    set-ups of peers. Raises SlambedError when there are none."""
    folder = folder or repository_root() / "experiments"
    found: list[str] = []
    for path in sorted(folder.glob("*.yaml")):
        content = load_yaml(path).data
        wanted = set(content.get("reproduces") or []) if isinstance(content, dict) else set()
        if any(wanted & paper.names() or path.stem in paper.setups for paper in papers):
            found.append(path.stem)
    if not found:
        names = ", ".join(paper.id for paper in papers)
        raise SlambedError(f"no experiment in {folder} reproduces anything of {names}")
    return found


def sizes_of(paper: Paper) -> dict[str, tuple[int, int, float]]:
    """Returns (cells, default runs per cell, played seconds) of every experiment of a paper; empty
    if no experiment reproduces any of it."""
    from slambed.campaign.plan import planned_runs
    from slambed.spec.library import Library

    library = Library()
    found: dict[str, tuple[int, int, float]] = {}
    try:
        names = experiments_of([paper])
    except SlambedError:
        return {}
    for name in names:
        experiment, source = library.experiment(name)
        usual = experiment.runs.default
        cells = planned_runs(experiment, source, library) // usual
        played = paper_seconds(paper)
        playback = experiment.playback
        end_s = playback.end_s if playback.end_s is not None else played
        found[name] = (cells, usual, end_s - playback.start_s)
    return found


def paper_seconds(paper: Paper) -> float:
    """Returns the longest time in s that the paper plays, if it is known."""
    known = [d.played_s for d in paper.datasets.values() if d.played_s is not None]
    return max(known, default=USUAL_S)


USUAL_S = 90.0
"""Assumed length of a sequence in s when the paper does not give one."""
