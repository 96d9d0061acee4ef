# SPDX-License-Identifier: Apache-2.0
"""A renamed or copied tree runs its own code and programs, or rebuilds them with one line of
output."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from slambed.native import repository_root

PYTHON = """#!/bin/sh
# The real one, without the packages that would have to be loaded.
case "$*" in
  "-m venv "*)
    {python} -m venv --without-pip "$3" || exit 1
    # As Python 3.11 and later write it down, whatever is tested.
    sed -i '/^command/d' "$3/pyvenv.cfg"
    echo "command = python3 -m venv $3" >>"$3/pyvenv.cfg"
    packages=$(echo "$3"/lib/python3*/site-packages)
    echo {folder}/nowhere >"$packages/__editable__.slambed-0.1.0.pth"
    printf '#!/bin/sh\\n' >"$3/bin/pip"
    chmod 755 "$3/bin/pip" ;;
  *) exec {python} "$@" ;;
esac
"""
START = """\
import sys
def main() -> None:
    print(__file__, *sys.argv)
"""


def without_packages() -> dict[str, str]:
    """Returns the environment without this checkout, which may be in PYTHONPATH."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}


class Tree:
    """The part of a checkout that the environment is built from."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "a tree"
        self.tools = folder / "programs"
        self.tools.mkdir()
        base = Path(sys.base_prefix) / "bin" / "python3"
        (self.tools / "python3").write_text(PYTHON.format(python=base, folder=folder))
        (self.tools / "python3").chmod(0o755)
        package = self.path / "harness" / "slambed"
        package.mkdir(parents=True)
        (package / "__init__.py").write_text("")
        (package / "start.py").write_text(START)
        for name in ("requirements.lock", "requirements-dev.lock", "pyproject.toml"):
            (self.path / name).write_text("")
        shutil.copytree(repository_root() / "tools", self.path / "tools")

    def make(self) -> str:
        path = f"{self.tools}:{os.environ['PATH']}"
        done = subprocess.run(
            [self.path / "tools" / "venv.sh"],
            capture_output=True,
            text=True,
            check=False,
            env=without_packages() | {"PATH": path},
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    def call(self, *arguments: str) -> str:
        program = self.path / ".venv" / "bin" / "slambed"
        done = subprocess.run(
            [program, *arguments],
            capture_output=True,
            text=True,
            check=True,
            env=without_packages(),
            cwd="/",
        )
        return done.stdout


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    return Tree(tmp_path)


def status_from(tree: Tree) -> str:
    return f"{tree.path}/harness/slambed/start.py {tree.path}/.venv/bin/slambed status 'x y'\n"


@pytest.mark.parametrize("how", ["copied", "renamed"])
def test_the_code_beside_the_environment_runs(tree: Tree, how: str) -> None:
    assert tree.make().splitlines()[-1] == "making .venv"
    assert tree.make() == ""
    assert tree.call("status", "'x y'") == status_from(tree)
    first, second = tree.path, tree.path.with_name("elsewhere")
    if how == "copied":
        shutil.copytree(first, second, symlinks=True)
    else:
        first.rename(second)
    tree.path = second
    assert tree.call("status", "'x y'") == status_from(tree)
    # The other programs there (pytest, mypy) contain the path where they were installed.
    assert tree.make().splitlines()[-1] == f"making .venv again: it was made in {first}/.venv"
    assert tree.make() == "" and tree.call("status", "'x y'") == status_from(tree)


def test_an_environment_that_trees_share_by_a_link_stays(tree: Tree) -> None:
    tree.make()
    shared = tree.path.with_name("shared")
    (tree.path / ".venv").rename(shared)
    (shared / "pyvenv.cfg").write_text(f"command = python3 -m venv {shared}\n")
    (tree.path / ".venv").symlink_to(shared)
    assert tree.make() == "" and (shared / "bin" / "slambed").is_file()


MADE_HERE = 'source "$1/tools/environment.sh" >/dev/null; made_here "$2" "$3"'
CACHE = "CMAKE_CACHEFILE_DIR:INTERNAL={build}\nCMAKE_HOME_DIRECTORY:INTERNAL={sources}\n"


@pytest.mark.parametrize("changed", ["nothing", "build", "sources"])
def test_a_build_of_another_place_is_made_again(tmp_path: Path, changed: str) -> None:
    """CMake rejects the first case, and would compile the other tree in the second."""
    build = tmp_path / "build"
    build.mkdir()
    named = {"build": build, "sources": tmp_path} | {changed: Path("/elsewhere")}
    (build / "CMakeCache.txt").write_text(
        CACHE.format(build=named["build"], sources=named["sources"])
    )
    command = ["bash", "-euc", MADE_HERE, "bash", repository_root(), build, tmp_path]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert build.exists() == (changed == "nothing")
    message = f"making build again: it was made in {named['build']}, of {named['sources']}\n"
    assert done.stdout == ("" if changed == "nothing" else message)
