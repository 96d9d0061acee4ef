# SPDX-License-Identifier: Apache-2.0
"""The import contracts of pyproject.toml reject the imports that they forbid."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from slambed.native import repository_root

LINT = Path(sys.executable).with_name("lint-imports")


NO_CYCLE = "No cycle between the modules of a package"


@pytest.mark.parametrize(
    ("module", "line", "broken"),
    [
        ("spec/system.py", "import slambed.campaign.order", "Packages import downwards only"),
        ("errors.py", "import slambed.terminal", "Packages import downwards only"),
        ("link/messages.py", "import slambed.engines.virtual", "Packages import downwards only"),
        ("campaign/run.py", "import slambed.report.load", "Packages import downwards only"),
        (
            "data/recipe.py",
            "import slambed.data.catalog",
            NO_CYCLE,
        ),
        ("newcomer.py", "", "Packages import downwards only"),
    ],
)
def test_a_wrong_import_breaks_its_contract(
    tmp_path: Path, module: str, line: str, broken: str
) -> None:
    root = repository_root()
    shutil.copy(root / "pyproject.toml", tmp_path)
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(root / "harness/slambed", tmp_path / "slambed", ignore=ignored)
    # A contract that is already broken would hide the result.
    kept = subprocess.run([LINT, "--no-cache"], cwd=tmp_path, capture_output=True, check=False)
    assert kept.returncode == 0
    path = tmp_path / "slambed" / module
    path.write_text((path.read_text() if path.is_file() else "") + f"\n{line}\n")
    done = subprocess.run(
        [LINT, "--no-cache"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert f"{broken} BROKEN" in done.stdout + done.stderr
