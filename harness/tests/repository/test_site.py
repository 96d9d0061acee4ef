# SPDX-License-Identifier: Apache-2.0
"""The documentation builds as a site, and a link that leads nowhere is an error."""

import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from html.parser import HTMLParser
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from browser import Page

from slambed.native import repository_root

TOOL = repository_root() / "tools" / "site.py"
ELSEWHERE = re.compile(r"\s*(https?:)?//")
LOADS = {"src", "srcset", "data", "poster"}
"""Attributes whose address a browser loads by itself; of a <link>, also href."""
DRAWN_LATER = {"mermaid", "pyodide", "glightbox"}
"""Elements of these classes make the theme's script load another one from unpkg.com."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    build = tmp_path_factory.mktemp("build")
    done = subprocess.run(
        [sys.executable, TOOL, build], capture_output=True, text=True, timeout=250, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return build / "site" / "html"


def test_the_site_builds_without_a_broken_link(site: Path) -> None:
    pages = list(site.rglob("index.html"))
    assert len(pages) >= len(list((repository_root() / "docs").rglob("*.md")))


class Loads(HTMLParser):
    """What a page has loaded from another host."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        names = LOADS | ({"href"} if tag == "link" else set())
        self.found += [
            values[name] for name in sorted(names & set(values)) if ELSEWHERE.match(values[name])
        ]
        self.found += sorted(DRAWN_LATER.intersection(values.get("class", "").split()))


def loads(page: str) -> list[str]:
    parser = Loads()
    parser.feed(page)
    return parser.found


def test_no_page_of_the_site_loads_anything_from_another_host(site: Path) -> None:
    pages = {path: loads(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    assert not {str(path): found for path, found in pages.items() if found}
    for path in site.rglob("*.css"):
        found = re.findall(r"(?:url\(|@import )[\"']?(?:https?:)?//[^)\"']*", path.read_text())
        assert not found, path


def test_what_a_page_loads_from_another_host_is_found() -> None:
    page = (
        '<link rel="icon" href="icon.png"><a href="https://example.org">a link loads nothing</a>'
        '<script src="//unpkg.com/a.js"></script><link rel="stylesheet" href="https://b.org/b.css">'
        '<img src="c.svg"><img src="https://d.org/d.png"><pre class="mermaid"></pre>'
    )
    assert loads(page) == [
        "//unpkg.com/a.js",
        "https://b.org/b.css",
        "https://d.org/d.png",
        "mermaid",
    ]


class Quiet(SimpleHTTPRequestHandler):
    """Serves a folder without a log."""

    def log_message(self, format: str, *args: object) -> None:
        """Says nothing."""


@pytest.fixture
def address(site: Path) -> Iterator[str]:
    with ThreadingHTTPServer(("localhost", 0), partial(Quiet, directory=str(site))) as server:
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        yield f"http://localhost:{server.server_port}"
        server.shutdown()


@pytest.mark.browser
def test_pages_in_a_browser_need_no_other_host_and_no_sideways_scrolling(
    page: Page, site: Path, address: str
) -> None:
    page.size(400)
    folders = [site, *sorted((site / "explanation").iterdir()), site / "how-to" / "explain-a-run"]
    for folder in (item for item in folders if (item / "index.html").exists()):
        page.open(f"{address}/{folder.relative_to(site)}/".replace("/./", "/"))
        loaded = page.value("performance.getEntriesByType('resource').map(entry => entry.name)")
        assert loaded and not [name for name in loaded if not name.startswith(address)]
        assert page.value("document.documentElement.scrollWidth") <= 400, folder


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
