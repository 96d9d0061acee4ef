# SPDX-License-Identifier: Apache-2.0
"""The package as a wheel, in its own environment and an empty folder, without a checkout.

Dependencies and compiled programs are those of this environment, so nothing is downloaded.
"""

import json
import os
import platform
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest
from checkout import known_files
from virtual_parts import make_sequence, needs_programs, write_experiment

from slambed.commands.doctor import PROGRAMS
from slambed.native import find_program, is_installed, repository_root
from slambed.spec.library import Library
from slambed.spec.software import source_hash


def copy_of(root: Path, target: Path) -> Path:
    """Copies the tracked files of the checkout, or without git (an unpacked archive) everything
    except build products."""
    listed = known_files(root)
    if not listed:
        made = {path.name for path in root.glob("build*")} | {".git", ".venv", "results", "docs"}
        return shutil.copytree(
            root,
            target,
            ignore=lambda folder, names: made & set(names) if Path(folder) == root else [],
            dirs_exist_ok=True,
        )
    for name in listed:
        if (root / name).is_file() and not name.startswith(("results/", "docs/")):
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(root / name, target / name)
    return target


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy to build wheels from, so that the checkout gets no build products."""
    return copy_of(repository_root(), tmp_path_factory.mktemp("source"))


@pytest.fixture(scope="module")
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel without programs."""
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*command, "--no-index", "-w", out, source], check=True)
    (found,) = out.glob("slambed-*.whl")
    return found


@pytest.fixture(scope="module")
def full_wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel with the programs that lie in build/bin."""
    out = tmp_path_factory.mktemp("full")
    build = find_program("slambed-sim").parents[1]
    subprocess.run([source / "tools/wheel.sh", build, out, sys.executable], check=True)
    (found,) = out.glob("slambed-*.whl")
    return found


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return install(wheel, tmp_path_factory.mktemp("own"))


def without_checkout() -> dict[str, str]:
    """Returns the environment without a checkout, which may be in PYTHONPATH."""
    return {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}


def install(wheel: Path, place: Path) -> Path:
    """Returns the program `slambed` of a new environment with the wheel."""
    venv.create(place, with_pip=False)
    python = place / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps"]
    # Otherwise pip could find slambed installed already.
    subprocess.run([*pip, "--no-index", wheel], check=True, env=without_checkout())
    (packages,) = place.glob("lib/python3*/site-packages")
    # Python reads no .pth files in a folder named by another .pth, so our editable slambed stays
    # out.
    (packages / "dependencies.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    return place / "bin" / "slambed"


def called(program: Path, cwd: Path, *arguments: str, **environment: str) -> str:
    unset = {"SLAMBED_BIN", "SLAMBED_CACHE", "PYTHONPATH"}
    inherited = {key: value for key, value in os.environ.items() if key not in unset}
    done = subprocess.run(
        [program, *arguments],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        env=inherited | {"SLAMBED_CACHE": str(cwd / "cache"), "COLUMNS": "200"} | environment,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_wheel_has_the_sources_and_files_of_the_checkout_and_no_tests(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    for name in ("CMakeLists.txt", "experiments/quickstart.yaml", "tools/build.sh", "commit"):
        assert f"slambed/checkout/{name}" in names
    assert not [n for n in names if "/tests/" in n or "/build/" in n or n.endswith(".pyc")]
    assert wheel.stat().st_size < 8e6


def test_it_knows_what_the_checkout_knows(installed: Path, tmp_path: Path) -> None:
    python = installed.parent / "python"
    asked = (
        "import slambed, slambed.native as n, slambed.spec.software as s;"
        "print(slambed.__file__, n.is_installed(), s.source_hash())"
    )
    where, from_wheel, sources = called(python, tmp_path, "-c", asked).split()
    assert Path(where).is_relative_to(installed.parents[1]) and from_wheel == "True"
    # The same programs and the same keys of runs.
    assert sources == source_hash() and not is_installed()


def test_commands_work_in_an_empty_folder(installed: Path, tmp_path: Path) -> None:
    assert "Usage: slambed" in called(installed, tmp_path, "run", "--help")
    assert "orbslam2" in called(installed, tmp_path, "systems")
    assert "synthetic_room" in called(installed, tmp_path, "data", "list")
    found = json.loads(called(installed, tmp_path, "experiments", "--json"))
    assert [item["name"] for item in found] == Library().experiments()
    checked = called(installed, tmp_path, "run", "quickstart", "--check", "--engine", "virtual")
    assert "quickstart.yaml: good" in checked and "run 'slambed setup'" in checked
    assert not list(tmp_path.iterdir())


def test_a_new_system_is_one_that_checks_out(installed: Path, tmp_path: Path) -> None:
    """pip has compiled the template's Python file, so a folder lies beside it."""
    (template,) = installed.parents[1].glob("**/catalog/templates/system")
    assert (template / "__pycache__").is_dir()
    called(installed, tmp_path, "new", "system", "mine")
    files = sorted(path.name for path in (tmp_path / "mine").iterdir())
    assert files == ["mine_beside_ours.yaml", "run.py", "system.yaml"]
    asked = ("systems", "show", "mine/system.yaml")
    assert "mobile" in called(installed, tmp_path, *asked)


def test_without_programs_it_says_how_to_get_them(installed: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [installed, "run", "quickstart", "--engine", "virtual"],
        cwd=tmp_path,
        text=True,
        capture_output=True,
        check=False,
        env=without_checkout() | {"SLAMBED_CACHE": str(tmp_path)},
    )
    assert done.returncode == 3
    assert "is not built" in done.stderr and "run 'slambed setup'" in done.stderr


@needs_programs
def test_the_wheel_with_programs_is_for_one_platform_and_has_the_licenses(full_wheel: Path) -> None:
    assert full_wheel.name.endswith(f"-py3-none-manylinux_2_36_{platform.machine()}.whl")
    assert full_wheel.stat().st_size < 60e6
    content = zipfile.ZipFile(full_wheel)
    (about,) = [name for name in content.namelist() if name.endswith(".dist-info/WHEEL")]
    assert b"Root-Is-Purelib: false" in content.read(about)
    build = "slambed/checkout/build"
    inside = {n.removeprefix(f"{build}/bin/") for n in content.namelist() if f"{build}/bin/" in n}
    assert inside == {*PROGRAMS, "sources.sha256"}
    assert content.read(f"{build}/bin/sources.sha256").decode().strip() == source_hash()
    for name in PROGRAMS:
        assert content.getinfo(f"{build}/bin/{name}").external_attr >> 16 & 0o111 == 0o111
    assert b"Lesser General Public" in content.read(f"{build}/licenses/libc6-dev")


@needs_programs
def test_programs_of_other_sources_make_no_wheel(source: Path, tmp_path: Path) -> None:
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "sources.sha256").write_text("000000000000\n")
    command = [source / "tools/wheel.sh", tmp_path, tmp_path / "out", sys.executable]
    done = subprocess.run(command, text=True, capture_output=True, check=False)
    assert done.returncode == 3 and not (tmp_path / "out").exists()
    assert f"{tmp_path}/bin has no programs of these sources; run 'make build'" in done.stderr


@needs_programs
def test_the_wheel_with_programs_runs_where_there_is_no_compiler(
    full_wheel: Path, tmp_path: Path
) -> None:
    program = install(full_wheel, tmp_path / "own")
    path = write_experiment(tmp_path, make_sequence(tmp_path / "walk", 2), runs=1)
    nothing = tmp_path / "no programs"
    nothing.mkdir()
    called(program, tmp_path, "run", str(path), "--no-figures", PATH=str(nothing))
    (report,) = (tmp_path / "results").glob("walk/report/index.html")
    manifest = json.loads(next((tmp_path / "results/runs").glob("*/manifest.json")).read_text())
    # Programs without the stamp of their sources would be named by their bytes.
    assert "+bin." not in manifest["spec"]["software"] and report.is_file()
    shown = called(program, tmp_path, "setup", "--engine", "virtual")
    assert shown.startswith(f"programs: {tmp_path}/own/lib")
    assert not (tmp_path / "cache" / "programs").exists()


@needs_programs
def test_it_runs_an_experiment_with_programs_that_are_there(
    installed: Path, tmp_path: Path
) -> None:
    path = write_experiment(tmp_path, make_sequence(tmp_path / "walk", 2), runs=1)
    programs = find_program("slambed-sim").parent
    out = called(installed, tmp_path, "run", str(path), "--no-figures", SLAMBED_BIN=str(programs))
    assert "walk" in out
    (folder,) = (tmp_path / "results").glob("walk")
    assert (folder / "report/index.html").is_file()
    manifest = json.loads(next((tmp_path / "results/runs").glob("*/manifest.json")).read_text())
    assert "software" in json.dumps(manifest)
