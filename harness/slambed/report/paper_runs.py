# SPDX-License-Identifier: Apache-2.0
"""Which experiments a paper's page is made of."""

from pathlib import Path

import yaml

from slambed.errors import SlambedError
from slambed.native import repository_root
from slambed.report.papers import Paper


def experiments_of(papers: list[Paper], folder: Path | None = None) -> list[str]:
    """Names of the experiment files that `reproduces` anything of these papers, and of the set-ups
    of peers. Raises SlambedError when there is none."""
    folder = folder or repository_root() / "experiments"
    found: list[str] = []
    for path in sorted(folder.glob("*.yaml")):
        try:
            content = yaml.safe_load(path.read_text(encoding="utf-8"))
        except (OSError, yaml.YAMLError) as error:
            raise SlambedError(f"cannot read an experiment, {path}, {error}") from error
        wanted = set(content.get("reproduces") or []) if isinstance(content, dict) else set()
        if any(wanted & paper.names() or path.stem in paper.setups for paper in papers):
            found.append(path.stem)
    if not found:
        names = ", ".join(paper.id for paper in papers)
        raise SlambedError(f"no experiment in {folder} reproduces anything of {names}")
    return found
