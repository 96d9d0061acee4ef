# SPDX-License-Identifier: Apache-2.0
"""Machines as people really have them: what their environment and their Docker do to commands."""

import io
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from command_line import refused, slambed_process
from docker.errors import DockerException
from rich.console import Console

from slambed.campaign import choose
from slambed.commands import doctor
from slambed.engines.docker_kinds import shortcomings
from slambed.errors import ExitCode, SlambedError
from slambed.files.outputs import SHEETS, figure_file
from slambed.native import repository_root

NOTEBOOK = "module://matplotlib_inline.backend_inline"


@pytest.mark.parametrize(
    "environment",
    [{"MPLBACKEND": NOTEBOOK}, {"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONUTF8": "0"}],
    ids=["notebook", "ascii", "locale C"],
)
def test_a_picture_is_drawn_in_any_environment(tmp_path: Path, environment: dict[str, str]) -> None:
    place = tmp_path / "größer"
    place.mkdir()
    command = ("profiles", "show", "ramp", "--output", str(place / "ramp"))
    code, out, err = slambed_process(*command, **environment)
    assert (code, err) == (ExitCode.OK, ""), err
    assert "plot: " in out
    assert (place / "ramp.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("given", "taken"),
    [("x", "x.png"), ("x.", "x.png"), ("x.png", "x.png"), ("x.PNG", "x.PNG"), ("x.svg", "x.svg")],
)
def test_an_output_name_has_an_ending(given: str, taken: str) -> None:
    assert figure_file(Path(given)) == Path(taken)


@pytest.mark.parametrize("given", ["x.jpg", "x.tar.gz", "x.png.txt", "x. png"])
def test_another_ending_is_refused(given: str) -> None:
    with pytest.raises(SlambedError, match=r"unknown picture format x.*; known: \.png"):
        figure_file(Path(given))


def test_a_sheet_is_a_png_and_says_so_before_anything_is_prepared(tmp_path: Path) -> None:
    assert figure_file(Path("x"), SHEETS) == Path("x.png")
    command = ("data", "show", "synthetic_room", "--output", str(tmp_path / "x.jpg"))
    line = refused(ExitCode.BAD_INPUT, *command, SLAMBED_CACHE=str(tmp_path / "cache"))
    assert line.endswith("x.jpg; known: .png")
    assert not (tmp_path / "cache").exists()


USUAL = {
    "CpuCfsQuota": True,
    "CPUSet": True,
    "MemoryLimit": True,
    "SecurityOptions": ["name=seccomp,profile=default"],
    "DockerRootDir": "/var/lib/docker",
    "ServerVersion": "27.1.1",
}
ROOTLESS = {"SecurityOptions": ["name=seccomp,profile=builtin", "name=rootless", "name=cgroupns"]}
WITHOUT_CPU = {"CpuCfsQuota": False, "CPUSet": False}
DAEMONS: dict[str, tuple[dict[str, Any], str]] = {
    "rootless without delegated cpu": (
        ROOTLESS | WITHOUT_CPU,
        "rootless Docker ignores CPU quotas, CPU sets, so runs of limited devices are invalid; "
        "delegate cpu",
    ),
    "rootless": (ROOTLESS, "rootless Docker was never tried"),
    "nested": (WITHOUT_CPU | {"MemoryLimit": False}, "CPU quotas, CPU sets, memory limits"),
    "snap": ({"DockerRootDir": "/var/snap/docker/common/var-lib-docker"}, "set SLAMBED_CACHE"),
}


class Daemon:
    def __init__(self, info: dict[str, Any]) -> None:
        self._info = info

    def info(self) -> dict[str, Any]:
        return self._info

    def close(self) -> None: ...


def test_a_usual_daemon_lacks_nothing() -> None:
    assert shortcomings(USUAL) == [] and shortcomings({}) == []


@pytest.mark.parametrize("kind", DAEMONS)
def test_what_a_daemon_does_not_do_is_a_line_of_the_doctor_and_of_the_run(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    changed, line = DAEMONS[kind]
    daemon = Daemon(USUAL | changed)
    monkeypatch.setattr(doctor, "connect", lambda: daemon)
    found = doctor._docker()
    assert found.level == "missing" and line in found.cost and "27.1.1" in found.found
    monkeypatch.setattr(choose, "connect", lambda: daemon)
    monkeypatch.setattr(choose, "find_image", lambda _: object())
    monkeypatch.setattr(choose, "DockerEngine", lambda *_, **__: object())
    monkeypatch.setattr(choose, "image_software", lambda: "s")
    out = io.StringIO()
    choose._docker(Console(file=out, width=60), lambda: None)
    printed = out.getvalue().splitlines()
    assert len(printed) == 1 and printed[0].startswith("note: ") and line in printed[0]


def test_a_daemon_that_goes_while_the_doctor_asks_it_is_a_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Leaving(Daemon):
        closed = False

        @property
        def images(self) -> SimpleNamespace:
            raise DockerException("it restarts")

        def close(self) -> None:
            self.closed = True

    daemon = Leaving(USUAL)
    monkeypatch.setattr(doctor, "connect", lambda: daemon)
    found = doctor._image()
    assert (found.level, daemon.closed) == ("missing", True)
    assert found.found == "Docker did not answer, asked to look for the node image: it restarts"


def test_systems_of_the_user_are_lines_of_the_doctor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    example = (repository_root() / "examples" / "opencv_odometry" / "system.yaml").read_text()
    lacks = example.replace("  python:\n", "  python:\n    apt: [bash, no-such-library]\n")
    for name, content in (("has", example), ("lacks", lacks), ("damaged", "name: [")):
        (tmp_path / name).mkdir()
        text = content.replace("name: opencv_odometry", f"name: {name}")
        (tmp_path / name / "system.yaml").write_text(text)
    assert doctor._own_systems() == []
    monkeypatch.setenv("SLAMBED_SYSTEMS", str(tmp_path))
    damaged, has, lacks_it = doctor._own_systems()
    assert (damaged.level, has.level, lacks_it.level) == ("missing", "good", "missing")
    assert "damaged/system.yaml" in damaged.found and has.topic == "system has"
    assert "sudo apt-get install no-such-library" in lacks_it.found


def test_one_cpu_is_a_line_of_the_doctor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor.os, "sched_getaffinity", lambda _: {0})
    found = doctor._cores()
    assert found.level == "missing" and "share one core" in found.cost


def test_the_doctor_says_what_a_missing_program_costs(monkeypatch: pytest.MonkeyPatch) -> None:
    gone = {"slambed-relay", "slambed-pace", "slambed-synth"}

    def find(name: str) -> Path:
        if name in gone:
            raise SlambedError(f"{name} is not built")
        return Path("bin") / name

    monkeypatch.setattr(doctor, "find_program", find)
    monkeypatch.setattr(doctor, "host_software", lambda: "s")
    found = doctor._programs()
    assert (found.level, found.found) == ("missing", "slambed-relay is not built")
    assert found.cost == "no live runs, no generated sequences"
    gone.clear()
    assert doctor._programs().level == "good"
