# SPDX-License-Identifier: Apache-2.0
"""docs/explanation/architecture.md names existing files."""

import re

from slambed.native import repository_root

NAMED = re.compile(r"`([\w./-]+\.(?:[ch]pp|py))`")


def test_every_source_that_the_page_names_is_there() -> None:
    root = repository_root()
    page = (root / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
    sources = [
        f"/{path.relative_to(root)}"
        for folder in ("systems", "harness")
        for path in (root / folder).rglob("*.*")
    ]
    named = NAMED.findall(page)
    assert len(named) > 40
    assert [name for name in named if not any(path.endswith(f"/{name}") for path in sources)] == []
