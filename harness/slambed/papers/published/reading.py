# SPDX-License-Identifier: Apache-2.0
"""Reads papers/*.yaml."""

from pathlib import Path

from slambed.errors import SlambedError
from slambed.files.yaml_source import read_model
from slambed.native import repository_root
from slambed.papers.published.paper import Paper

PLAN_SUFFIX = ".plan.yaml"
"""Plans lie beside the papers that they are about."""


def papers_folder() -> Path:
    """The papers/ of this checkout."""
    return repository_root() / "papers"


def read_paper(path: Path) -> Paper:
    """Raises SlambedError with file, line, key and reason when the file is not as described."""
    return read_model(Paper, path)


def paper_files() -> dict[str, Path]:
    """Name of every paper and where its file lies."""
    files = sorted(papers_folder().glob("*.yaml"))
    return {path.stem: path for path in files if not path.name.endswith(PLAN_SUFFIX)}


def read_papers(names: list[str] | None = None) -> list[Paper]:
    """All papers, or those named; a wrong name lists the right ones."""
    files = paper_files()
    for name in names or []:
        if name not in files:
            known = ", ".join(files)
            raise SlambedError(f"no paper '{name}' in {papers_folder()}; known: {known}")
    return [read_paper(files[name]) for name in names or files]
