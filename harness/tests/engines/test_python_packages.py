# SPDX-License-Identifier: Apache-2.0
"""`runtime: python:`: packages are installed once per set of requirements, or refused in a line."""

import shutil
import subprocess
import zipfile
from pathlib import Path
from unittest.mock import Mock

import pytest
import yaml
from pydantic import ValidationError

from slambed.engines import docker_segmenter, python_packages
from slambed.engines.base import NodePlan, last_line
from slambed.engines.docker_python import build_python_image, image_name, python_volume
from slambed.engines.docker_segmenter import start_segmenter
from slambed.engines.foreign import container_options, environment
from slambed.engines.python_packages import (
    find_environment,
    kept_environment,
    make_environment,
    must_have_debian_packages,
)
from slambed.errors import ExitCode, SlambedError
from slambed.native import repository_root
from slambed.spec.device import Limits
from slambed.spec.runtime import PythonPackages, Runtime, foreign_digest


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv("SLAMBED_CACHE", str(folder))
    return folder


def wheel(folder: Path, version: str) -> str:
    """A package of one module, as pip's requirement."""
    path = folder / f"tiny_slam-{version}-py3-none-any.whl"
    info = f"tiny_slam-{version}.dist-info"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("tiny_slam.py", f"VERSION = '{version}'\n")
        file.writestr(
            f"{info}/METADATA", f"Metadata-Version: 2.1\nName: tiny-slam\nVersion: {version}\n"
        )
        file.writestr(
            f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        file.writestr(f"{info}/RECORD", "")
    return f"tiny-slam @ {path.as_uri()}"


def quiet(line: str) -> None:
    """Progress that nobody reads."""


def test_packages_are_installed_once_and_named_with_their_versions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    python = PythonPackages(requires=[wheel(tmp_path, "1.5")])
    with pytest.raises(SlambedError, match="not installed yet"):
        kept_environment(python, tmp_path)
    told: list[str] = []
    made = make_environment(python, tmp_path, told.append)
    assert made.versions == {"tiny-slam": "1.5"} and made.lock == "tiny-slam==1.5\n"
    assert len(told) == 1 and "tiny-slam" in told[0]
    found = subprocess.run(
        [made.programs / "python3", "-c", "import tiny_slam; print(tiny_slam.VERSION)"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert found.stdout == "1.5\n"
    assert (made.folder / made.packages_inside / "tiny_slam.py").is_file()
    monkeypatch.setattr(python_packages, "_run", None)  # nothing is started again
    assert make_environment(python, tmp_path, told.append) == made
    assert kept_environment(python, tmp_path) == made and len(told) == 1


def test_the_users_python_path_does_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    elsewhere = tmp_path / "elsewhere" / "other-1.0.dist-info"
    elsewhere.mkdir(parents=True)
    (elsewhere / "METADATA").write_text("Metadata-Version: 2.1\nName: other\nVersion: 1.0\n")
    monkeypatch.setenv("PYTHONPATH", str(elsewhere.parent))
    python = PythonPackages(requires=[wheel(tmp_path, "1.5")])
    assert make_environment(python, tmp_path, quiet).versions == {"tiny-slam": "1.5"}


def test_what_an_interrupted_installation_left_is_made_again(tmp_path: Path) -> None:
    python = PythonPackages(requires=[wheel(tmp_path, "1.5")])
    folder = find_environment(python, tmp_path).folder
    (folder / "bin").mkdir(parents=True)
    (folder / "bin" / "python3").write_text("half")
    assert make_environment(python, tmp_path, quiet).versions == {"tiny-slam": "1.5"}


def test_a_package_that_cannot_be_had_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    wheel = tmp_path / "tiny_slam-1.0-py3-none-any.whl"
    python = PythonPackages(requires=[f"tiny-slam @ {wheel.as_uri()}"])
    with pytest.raises(SlambedError) as refused:
        make_environment(python, tmp_path / "mine", quiet)
    assert refused.value.code == ExitCode.ENVIRONMENT
    line = str(refused.value)
    assert "packages of mine cannot be installed" in line and wheel.name in line
    assert "\n" not in line
    assert not find_environment(python, tmp_path / "mine").folder.exists()


def test_a_missing_python_and_a_missing_file_are_named(tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match=r"needs Python 3\.99, and there is no python3\.99"):
        make_environment(PythonPackages(requires=["x"], version="3.99"), tmp_path / "mine", quiet)
    with pytest.raises(SlambedError, match=r"wanted\.txt: No such file"):
        make_environment(PythonPackages(requirements="wanted.txt"), tmp_path, quiet)


def test_the_environment_depends_on_what_a_requirements_file_says(tmp_path: Path) -> None:
    python, file = PythonPackages(requirements="wanted.txt"), tmp_path / "wanted.txt"
    file.write_text(wheel(tmp_path, "1.5") + "\n")
    first = make_environment(python, tmp_path, quiet)
    file.write_text(wheel(tmp_path, "1.6") + "\n")
    second = make_environment(python, tmp_path, quiet)
    assert first.folder != second.folder
    assert (first.versions, second.versions) == ({"tiny-slam": "1.5"}, {"tiny-slam": "1.6"})


@pytest.mark.skipif(shutil.which("dpkg-query") is None, reason="needs dpkg")
def test_missing_debian_packages_are_named_with_the_command(tmp_path: Path) -> None:
    present = PythonPackages(requires=["x"], apt=["dpkg"])
    must_have_debian_packages(present, tmp_path)
    missing = present.model_copy(update={"apt": ["dpkg", "no-such-lib1"]})
    with pytest.raises(SlambedError, match=r"not installed: no-such-lib1; run 'sudo apt-get"):
        must_have_debian_packages(missing, tmp_path)


@pytest.mark.parametrize(
    "wrong",
    [
        {},
        {"requires": ["numpy"], "requirements": "wanted.txt"},
        {"requires": ["--index-url=http://example.org"]},
        {"requires": ["numpy"], "version": "2.7"},
        {"requires": ["numpy"], "apt": ["; reboot"]},
    ],
)
def test_what_is_no_list_of_packages_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        PythonPackages.model_validate(wrong)


def plan_of(python: PythonPackages, folder: Path) -> NodePlan:
    runtime = Runtime.model_validate(
        {"python": python.model_dump(), "mobile": {"command": ["python3", "run.py"]}}
    )
    return NodePlan("mobile", "key", folder, folder, Limits(), [0], False, runtime, folder)


def test_a_node_gets_the_packages_on_both_engines(tmp_path: Path) -> None:
    python = PythonPackages(requires=[wheel(tmp_path, "1.5")], apt=["libgl1"])
    made = make_environment(python, tmp_path, quiet)
    plan = plan_of(python, tmp_path)
    assert environment(plan, "/clients", "/bin")["PATH"] == f"{made.programs}:/bin"
    options = container_options(plan, "image", "/out/run.json", "/out/go")
    inside = f"/slambed/client:/python/{made.packages_inside}"
    assert options["environment"]["PYTHONPATH"] == inside
    assert python_volume(plan) == {str(made.folder): {"bind": "/python", "mode": "ro"}}


def test_the_image_follows_from_the_debian_packages_alone(tmp_path: Path) -> None:
    def image(**settings: object) -> str:
        plan = plan_of(PythonPackages.model_validate(settings), tmp_path)
        assert plan.runtime is not None
        return image_name(plan.runtime, "mobile", "mine")

    first = image(requires=["a"], apt=["libgl1", "libsm6"])
    assert first == image(requires=["b"], apt=["libsm6", "libgl1"])
    assert first != image(requires=["a"], apt=["libgl1"])


def test_the_image_has_the_python_of_the_packages(tmp_path: Path) -> None:
    def image(version: str) -> str:
        plan = plan_of(PythonPackages(requires=["a"], version=version), tmp_path)
        assert plan.runtime is not None
        return image_name(plan.runtime, "mobile", "mine")

    assert len({image("3.11"), image("3.12"), image("3.13")}) == 3
    refused = r"system mine has packages of Python 3\.9, and slambed makes images with 3\.11, "
    with pytest.raises(SlambedError, match=refused):
        image("3.9")


def test_a_host_without_the_docker_command_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its daemon may be there, or another machine's."""
    monkeypatch.setenv("PATH", str(tmp_path))
    python = PythonPackages(requires=["numpy"], version="3.11")
    line = "the image of system mine needs the command docker, .*install docker.io or docker-cli"
    with pytest.raises(SlambedError, match=line) as raised:
        build_python_image(python, "mine:1", "mine")
    assert raised.value.code == ExitCode.ENVIRONMENT
    (tmp_path / "bash").symlink_to("/bin/bash")
    script = str(repository_root() / "tools" / "base_image.sh")
    done = subprocess.run(["bash", script], capture_output=True, text=True, check=False)
    assert done.stderr == "error: no docker command; install docker.io or docker-cli\n"
    assert done.returncode == ExitCode.ENVIRONMENT

    monkeypatch.setattr(docker_segmenter, "group_of_edge", lambda *_: "parent")
    plan = plan_of(python, tmp_path)
    with pytest.raises(SlambedError, match="the segmenter needs the command docker"):
        start_segmenter(Mock(), Mock(), plan, 1, "slambed_people")


def test_run_keys_depend_on_the_installed_versions(tmp_path: Path) -> None:
    runtime = plan_of(PythonPackages(requires=["a"]), tmp_path).runtime
    assert runtime is not None
    first = foreign_digest(runtime, tmp_path, {"mobile": "sha256:1"}, "a==1\n")
    assert foreign_digest(runtime, tmp_path, {"mobile": "sha256:1"}, "a==1\n") == first
    assert foreign_digest(runtime, tmp_path, {"mobile": "sha256:1"}, "a==2\n") != first


def test_the_last_words_of_a_python_program_are_its_exception(tmp_path: Path) -> None:
    log = tmp_path / "log.txt"
    log.write_text(
        "loading\nTraceback (most recent call last):\n  File 'run.py', line 3\n    slam.trak()\n"
        "AttributeError: no attribute 'trak'\nShutdown\n"
    )
    assert last_line(log) == "AttributeError: no attribute 'trak'"
    log.write_text("loading\nShutdown\n")
    assert last_line(log) == "Shutdown"


@pytest.mark.parametrize(
    ("name", "package"),
    [("orb_slam3", "pyorbslam3"), ("opencv_odometry", "opencv-python-headless")],
)
def test_the_examples_of_pypi_name_what_they_need(name: str, package: str) -> None:
    file = repository_root() / "examples" / name / "system.yaml"
    runtime = Runtime.model_validate(yaml.safe_load(file.read_text())["runtime"], strict=True)
    assert runtime.python is not None and runtime.python.requires[0].startswith(f"{package}==")
