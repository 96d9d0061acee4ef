# SPDX-License-Identifier: Apache-2.0
"""The documentation builds as a site, and a link that leads nowhere is an error."""

import shutil
import subprocess
import sys
from pathlib import Path

from slambed.native import repository_root

TOOL = repository_root() / "tools" / "site.py"


def test_the_site_builds_without_a_broken_link(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, TOOL, tmp_path], capture_output=True, text=True, timeout=250, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    pages = list((tmp_path / "site" / "html").rglob("index.html"))
    assert len(pages) >= len(list((repository_root() / "docs").rglob("*.md")))


def test_links_to_files_that_do_not_exist_are_named(tmp_path: Path) -> None:
    """In a small repository with a copy of the tool."""
    for folder in ("tools", "docs", "systems", "catalog/schemas"):
        (tmp_path / folder).mkdir(parents=True)
    tool = Path(shutil.copy(TOOL, tmp_path / "tools"))
    (tmp_path / "docs" / "index.md").write_text(
        "[good](index.md) [code](../systems)\n"
        "![picture](pictures/none.png)\n"
        "```\n[not a link](in_code.md)\n```\n[bad](nowhere.md)\n"
    )
    done = subprocess.run([sys.executable, tool], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == (
        "error: docs/index.md:2: pictures/none.png does not exist\n"
        "error: docs/index.md:6: nowhere.md does not exist\n"
    )
    staged = (tmp_path / "build" / "site" / "docs" / "index.md").read_text()
    assert "[good](index.md) code\n" in staged and "[not a link](in_code.md)" in staged
