#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""site.py [BUILD_FOLDER]: the documentation of docs/ as a site in BUILD_FOLDER/site/html.

A link of docs/ to another file of the repository becomes a link to SLAMBED_REPOSITORY (an address
such as https://github.com/owner/slambed), or plain text where that is not set. A link to a page,
heading, picture or file that does not exist is an error.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LINK = re.compile(r"(?P<picture>!?)\[(?P<text>(?:[^][]|\[[^]]*\])*)\]\((?P<target>[^)\s]+)\)")
FENCE = re.compile(r"^\s*(```|~~~)")


class Page:
    """One page of docs/ on its way into the site."""

    def __init__(self, path: Path, repository: str, commit: str) -> None:
        self._path = path
        self._repository = repository
        self._commit = commit
        self.broken: list[str] = []

    def text(self) -> str:
        """The page as the site has it."""
        lines, fenced = [], False
        for number, line in enumerate(self._path.read_text(encoding="utf-8").splitlines(), 1):
            if FENCE.match(line):
                fenced = not fenced
            if not fenced:
                line = LINK.sub(lambda found, number=number: self._link(found, number), line)
            lines.append(line)
        return "\n".join([*lines, ""])

    def _link(self, found: re.Match[str], number: int) -> str:
        target, _, heading = found["target"].partition("#")
        if not target or ":" in target:
            return found[0]
        place = (self._path.parent / target).resolve()
        if not place.exists():
            name = self._path.relative_to(ROOT)
            self.broken.append(f"{name}:{number}: {found['target']} does not exist")
        if place.is_relative_to(ROOT / "docs"):
            return found[0]
        if not self._repository:
            return found["text"]
        kind = "tree" if place.is_dir() else "blob"
        address = f"{self._repository}/{kind}/{self._commit}/{place.relative_to(ROOT)}"
        return f"{found['picture']}[{found['text']}]({address}{'#' + heading if heading else ''})"


def main() -> int:
    """Stages the pages and has Zensical build them."""
    build = ROOT / (sys.argv[1] if len(sys.argv) > 1 else "build") / "site"
    repository = os.environ.get("SLAMBED_REPOSITORY", "").rstrip("/")
    commit = os.environ.get("SLAMBED_COMMIT", "main")
    shutil.rmtree(build, ignore_errors=True)
    broken: list[str] = []
    for path in sorted((ROOT / "docs").rglob("*")):
        staged = build / "docs" / path.relative_to(ROOT / "docs")
        if path.is_dir():
            staged.mkdir(parents=True, exist_ok=True)
        elif path.suffix == ".md":
            staged.parent.mkdir(parents=True, exist_ok=True)
            page = Page(path, repository, commit)
            staged.write_text(page.text(), encoding="utf-8")
            broken += page.broken
        else:
            staged.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, staged)
    for line in broken:
        print(f"error: {line}", file=sys.stderr)
    if broken:
        return 1
    config = build / "zensical.toml"
    text = (ROOT / "zensical.toml").read_text(encoding="utf-8")
    config.write_text(text.replace('"build/site/', '"'), encoding="utf-8")
    program = Path(sys.executable).with_name("zensical")
    done = subprocess.run([str(program), "build", "--strict", "--config-file", str(config)],
                          cwd=build, env=os.environ | {"NO_COLOR": "1"}, check=False)  # fmt: skip
    if done.returncode == 0:
        print(f"site: {build / 'html' / 'index.html'}")
    return 1 if done.returncode else 0


if __name__ == "__main__":
    sys.exit(main())
