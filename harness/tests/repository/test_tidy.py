# SPDX-License-Identifier: Apache-2.0
"""tools/tidy.sh, which runs clang-tidy on the compiled units, in a path with a blank."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from slambed.native import repository_root

HERE = repository_root()

pytestmark = pytest.mark.skipif(
    not (HERE / ".venv" / "bin" / "clang-tidy").is_file(), reason="needs clang-tidy ('make check')"
)


def tidy(folder: Path, source: str) -> subprocess.CompletedProcess[str]:
    """Runs the script on one unit, as if GCC 12 had compiled it."""
    root = folder / "my work" / "slambed"
    (root / "tools").mkdir(parents=True)
    for name in ("tidy.sh", "tidy_units.py", "environment.sh"):
        shutil.copy(HERE / "tools" / name, root / "tools")
    shutil.copy(HERE / ".clang-tidy", root)
    (root / ".venv").symlink_to(HERE / ".venv")
    compiler = root / "gcc-12"
    compiler.write_text("#!/bin/sh\necho 12\n")
    compiler.chmod(0o755)
    (root / "unit.cpp").write_text(source)
    build = root / "build"
    build.mkdir()
    (build / "CMakeCache.txt").write_text(
        f"CMAKE_CACHEFILE_DIR:INTERNAL={build}\nCMAKE_HOME_DIRECTORY:INTERNAL={root}\n"
        f"CMAKE_CXX_COMPILER:FILEPATH={compiler}\n"
    )
    unit = {"directory": str(build), "file": str(root / "unit.cpp")}
    command = f'c++ -o unit.o -c "{root / "unit.cpp"}"'
    (build / "compile_commands.json").write_text(json.dumps([{**unit, "command": command}]))
    return subprocess.run(
        ["bash", "tools/tidy.sh", "build"], cwd=root, capture_output=True, text=True, timeout=120
    )


def test_a_unit_without_a_fault_passes(tmp_path: Path) -> None:
    done = tidy(tmp_path, "int first(int a) { return a; }\n")
    assert done.returncode == 0 and done.stdout.endswith("clang-tidy: 1 units\n"), done.stderr


def test_a_fault_is_refused(tmp_path: Path) -> None:
    done = tidy(tmp_path, "int first(int a) { return a == a; }\n")
    assert done.returncode == 1 and "misc-redundant-expression" in done.stdout, done.stdout
    assert "error: clang-tidy refuses the above" in done.stderr
