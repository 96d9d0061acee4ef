# SPDX-License-Identifier: Apache-2.0
"""Which units clang-tidy checks again after a change (tools/tidy_units.py)."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from checkout import needs_git

from slambed.native import repository_root

TOOL = repository_root() / "tools" / "tidy_units.py"
NINJA = """\
rule cc
  command = c++ -MD -MF $out.d -c $in -o $out
  depfile = $out.d
  deps = gcc
build a.o: cc ../src/a.cpp
build b.o: cc ../src/b.cpp
build t.o: cc ../src/tests/t.cpp
"""
COMMANDS = """[
 {"directory": "x", "command": "c++ -c a.cpp -o a.o", "file": "src/a.cpp"},
 {"directory": "x", "command": "c++ -c b.cpp -o b.o", "file": "src/b.cpp"},
 {"directory": "x", "command": "c++ -c t.cpp -o t.o", "file": "src/tests/t.cpp"}
]"""

pytestmark = [
    needs_git,
    pytest.mark.skipif(
        shutil.which("ninja") is None or shutil.which("c++") is None,
        reason="needs a compiler and ninja ('make build')",
    ),
]


class Project:
    """Two units, one of which includes a header, and a test; compiled and committed."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        files = {
            "src/a.cpp": '#include "h.hpp"\nint a() { return h; }\n',
            "src/b.cpp": "int b() { return 1; }\n",
            "src/h.hpp": "#pragma once\ninline int h = 2;\n",
            "src/tests/t.cpp": '#include "../h.hpp"\nint t() { return h; }\n',
            "cmake/flags.cmake": "",
            "build/build.ninja": NINJA,
            "build/compile_commands.json": COMMANDS,
        }
        for name, text in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text)
        self.run("ninja", "-C", "build", "--quiet")
        self.run("git", "init", "-q")
        self.run("git", "add", "src", "cmake")
        identity = ("-c", "user.name=a", "-c", "user.email=a@example.org")
        self.run("git", *identity, "commit", "-qm", "first")

    def run(self, *command: str) -> str:
        done = subprocess.run(
            command, cwd=self.folder, capture_output=True, text=True, check=True, timeout=60
        )
        return done.stdout

    def units(self, *options: str) -> list[str]:
        return self.run(sys.executable, str(TOOL), "build", *options).split()


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return Project(tmp_path)


def test_without_a_commit_all_units_but_tests_are_read(project: Project) -> None:
    assert project.units() == ["src/a.cpp", "src/b.cpp"]
    assert project.units("--pattern", "b.c") == ["src/b.cpp"]


def test_only_what_hangs_on_a_changed_file_is_read(project: Project) -> None:
    assert project.units("--since", "HEAD") == []
    (project.folder / "src" / "h.hpp").write_text("#pragma once\ninline int h = 3;\n")
    assert project.units("--since", "HEAD") == ["src/a.cpp"]
    project.run("git", "checkout", "-q", "src")
    project.run("git", "rm", "-q", "--cached", "src/b.cpp")  # like a file that was never added
    assert project.units("--since", "HEAD") == ["src/b.cpp"]


@pytest.mark.parametrize("name", ["cmake/flags.cmake", "no such commit"])
def test_all_are_read_where_anything_may_have_changed(project: Project, name: str) -> None:
    commit = "0" * 40
    if name.startswith("cmake"):
        (project.folder / name).write_text("add_compile_options(-Wall)\n")
        commit = "HEAD"
    assert project.units("--since", commit) == ["src/a.cpp", "src/b.cpp"]
