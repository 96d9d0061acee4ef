# SPDX-License-Identifier: Apache-2.0
"""Reads published numbers from papers/<id>/paper.yaml."""

from pathlib import Path

from slambed.errors import SlambedError
from slambed.files.yaml_source import read_model
from slambed.native import repository_root
from slambed.papers.published.paper import Paper

PAPER_FILE, PLAN_FILE = "paper.yaml", "plan.yaml"
"""Files in the folder of a paper, which is named by its id."""


def papers_folder() -> Path:
    return repository_root() / "papers"


def read_paper(path: Path) -> Paper:
    """Reads one file. Raises SlambedError with file, line, key and reason if it is invalid."""
    return read_model(Paper, path)


def paper_files() -> dict[str, Path]:
    """Maps the name of every paper to its file."""
    return {path.parent.name: path for path in sorted(papers_folder().glob(f"*/{PAPER_FILE}"))}


def read_papers(names: list[str] | None = None) -> list[Paper]:
    """Reads all papers, or those named. Raises SlambedError with the known names for an unknown
    one."""
    files = paper_files()
    for name in names or []:
        if name not in files:
            if (former := papers_folder() / f"{name}.yaml").is_file():
                what_now = f"move it to {papers_folder() / name / PAPER_FILE}"
                raise SlambedError(f"no paper '{name}': {former} is no longer read, {what_now}")
            known = ", ".join(files)
            raise SlambedError(f"no paper '{name}' in {papers_folder()}; known: {known}")
    return [read_paper(files[name]) for name in names or files]
