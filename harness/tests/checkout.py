# SPDX-License-Identifier: Apache-2.0
"""Files that git tracks in this checkout; an archive has no history, and its host maybe no git."""

import shutil
import subprocess
from pathlib import Path

import pytest

from slambed.native import repository_root

HAS_GIT = shutil.which("git") is not None
HAS_HISTORY = HAS_GIT and (repository_root() / ".git").exists()
needs_git = pytest.mark.skipif(not HAS_GIT, reason="needs the program git")
needs_history = pytest.mark.skipif(not HAS_HISTORY, reason="needs the history of a checkout")


def known_files(root: Path, *patterns: str) -> list[str]:
    """Returns tracked files that match; empty without history."""
    if not HAS_HISTORY:
        return []
    command = ["git", "-C", str(root), "ls-files", "-z", "--cached", "--others"]
    listed = subprocess.run(
        [*command, "--exclude-standard", "--", *patterns], capture_output=True, check=True
    )
    return list(filter(None, listed.stdout.decode().split("\0")))
