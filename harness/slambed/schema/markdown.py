# SPDX-License-Identifier: Apache-2.0
"""Markdown of what models and commands say of themselves in plain sentences."""

import re
from collections.abc import Iterable

PAGE = re.compile(r"\bdocs/([a-z-]+)/([a-z-]+)\.md(?:, \"([^\"]+)\")?")
"""A page of docs/ as a docstring names it, with one of its headings."""
SPECIAL = {"<": "&lt;", "*": "\\*"}


def prose(sentence: str) -> str:
    """A sentence outside of code; a page of docs/ that it names becomes a link from docs/*/."""
    parts = sentence.split("`")
    for index in range(0, len(parts), 2):
        for plain, escaped in SPECIAL.items():
            parts[index] = parts[index].replace(plain, escaped)
        parts[index] = PAGE.sub(_link, parts[index])
    return "`".join(parts)


def _link(found: re.Match[str]) -> str:
    folder, page, heading = found.groups()
    anchor = "#" + re.sub(r"[^a-z0-9]+", "-", heading.lower()).strip("-") if heading else ""
    words = heading or page.replace("-", " ")
    return f"[{words}](../{folder}/{page}.md{anchor})"


def markdown_table(headings: list[str], rows: Iterable[list[str]]) -> str:
    """Lines of a table."""
    rule = ["---"] * len(headings)
    return "".join(f"| {' | '.join(row)} |\n" for row in (headings, rule, *rows))
