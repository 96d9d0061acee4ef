# SPDX-License-Identifier: Apache-2.0
"""papers/<id>/runs.tar.xz: the packed runs of a paper's campaign, shown without playing anything.

They lie in a folder of their own and never in `results/`: a campaign must not take runs of other
sources for its own.
"""

import hashlib
import shutil
from pathlib import Path

from slambed.campaign.pack import extract
from slambed.native import is_installed
from slambed.papers.published.reading import papers_folder
from slambed.report.load import Results, load

KEPT_FILE = "runs.tar.xz"
ALL_SYSTEMS_FOLDER = "all_systems"
"""Folder in papers/ with the packed runs of the comparison of all systems, which is in no paper."""
MARKER = "archive.sha256"
"""Digest of the archive that a folder was extracted from."""


def kept_file(paper: str, folder: Path | None = None) -> Path | None:
    """Returns the archive with the packed runs of a paper; None if there is none."""
    path = (folder or papers_folder()) / paper / KEPT_FILE
    return path if path.is_file() else None


def no_runs_words(paper: str) -> str:
    """Returns the phrase of a page without runs: whether some are kept, and how to see them."""
    if is_installed():
        return "no runs yet; a wheel has no packed runs, 'make kept' in a checkout shows them"
    if kept_file(paper) is None:
        return f"no runs yet; none are kept in papers/{paper}/{KEPT_FILE}"
    return f"no runs yet; kept ones are shown by slambed papers kept {paper}"


def read_kept(archive: Path, place: Path) -> list[Results]:
    """Extracts an archive into `place`, unless it is there already, and loads its experiments.

    Raises SlambedError for a torn archive or a folder that cannot be written.
    """
    digest = hashlib.sha256(archive.read_bytes()).hexdigest()
    marker = place / MARKER
    if not marker.is_file() or marker.read_text().strip() != digest:
        shutil.rmtree(place, ignore_errors=True)
        extract(archive, place)
        marker.write_text(f"{digest}\n")
    return [load(path.parent) for path in sorted(place.glob("*/experiment.json"))]
