# SPDX-License-Identifier: Apache-2.0
"""Reads the published numbers, papers/<id>/paper.yaml."""

from pathlib import Path

from slambed.errors import SlambedError
from slambed.files.yaml_source import read_model
from slambed.native import repository_root
from slambed.papers.published.paper import Paper

PAPER_FILE, PLAN_FILE = "paper.yaml", "plan.yaml"
"""Of the folder that has everything about one paper, and its id as a name."""


def papers_folder() -> Path:
    """The papers/ of this checkout."""
    return repository_root() / "papers"


def read_paper(path: Path) -> Paper:
    """Raises SlambedError with file, line, key and reason when the file is not as described."""
    return read_model(Paper, path)


def paper_files() -> dict[str, Path]:
    """Name of every paper and where its file lies."""
    return {path.parent.name: path for path in sorted(papers_folder().glob(f"*/{PAPER_FILE}"))}


def read_papers(names: list[str] | None = None) -> list[Paper]:
    """All papers, or those named; a wrong name lists the right ones."""
    files = paper_files()
    for name in names or []:
        if name not in files:
            if (former := papers_folder() / f"{name}.yaml").is_file():
                what_now = f"move it to {papers_folder() / name / PAPER_FILE}"
                raise SlambedError(f"no paper '{name}': {former} is no longer read, {what_now}")
            known = ", ".join(files)
            raise SlambedError(f"no paper '{name}' in {papers_folder()}; known: {known}")
    return [read_paper(files[name]) for name in names or files]
