# SPDX-License-Identifier: Apache-2.0
"""The how-to pages show the files that `slambed new` writes today."""

import re
from pathlib import Path

import pytest
from command_line import slambed

from slambed.errors import ExitCode
from slambed.native import repository_root


@pytest.mark.parametrize(
    ("kind", "name", "page"),
    [
        ("dataset", "my_walk", "generate-a-sequence.md"),
        ("experiment", "wave", "write-an-experiment.md"),
    ],
)
def test_a_page_shows_the_file_that_is_written(
    kind: str, name: str, page: str, tmp_path: Path
) -> None:
    code, _, err = slambed("new", kind, name, cwd=tmp_path)
    assert code == ExitCode.OK, err
    written = (tmp_path / f"{name}.yaml").read_text().splitlines(keepends=True)
    text = (repository_root() / "docs" / "how-to" / page).read_text()
    assert f"$ slambed new {kind} {name}\n" in text
    shown = re.search(r"^```yaml\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert shown is not None
    assert shown[1] == "".join(line for line in written if not line.startswith("#"))
