# SPDX-License-Identifier: Apache-2.0
"""Virtual runs of the same sources built by another compiler have other keys; live ones do not."""

import os
from pathlib import Path

import pytest

from slambed.errors import ExitCode, SlambedError
from slambed.native import SIMULATION
from slambed.spec.software import (
    STAMP,
    host_software,
    image_software,
    software_of_systems,
    source_hash,
)

GCC = (
    '{"compiler": "gcc 12.2.0", "standard_library": "libstdcxx 12", '
    '"libraries": "eigen 3.4.0, turbojpeg 2.1.5"}'
)
MACHINE = "@gcc12.2.0-libstdcxx12-eigen3.4.0-turbojpeg2.1.5"


@pytest.fixture
def programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Programs of this checkout's sources, whose simulation reports `says` about itself."""
    monkeypatch.setenv("SLAMBED_BIN", str(tmp_path))
    (tmp_path / STAMP).write_text(source_hash())
    (tmp_path / "slambed-node").touch()
    program = tmp_path / SIMULATION
    program.write_text(f"#!/bin/sh\necho asked >>{tmp_path}/asked\ncat {tmp_path}/says\n")
    program.chmod(0o755)
    (tmp_path / "says").write_text(GCC)
    return tmp_path


def rebuilt(programs: Path, says: str) -> str:
    (programs / "says").write_text(says)
    status = (programs / SIMULATION).stat()
    later = (status.st_atime_ns, status.st_mtime_ns + 1_000_000)
    os.utime(programs / SIMULATION, ns=later)
    return host_software(program=SIMULATION)


def test_compiler_and_libraries_are_in_a_virtual_runs_software(
    programs: Path,
) -> None:
    assert host_software(program=SIMULATION) == image_software() + MACHINE
    for other in ("gcc 13.1.0", "Clang 14.0.6"):
        assert rebuilt(programs, GCC.replace("gcc 12.2.0", other)) != image_software() + MACHINE
    newer = GCC.replace("libstdcxx 12", "libstdcxx 13")  # the same clang with other headers
    assert rebuilt(programs, newer) != image_software() + MACHINE
    # An architecture whose bytes were never compared names itself; x86-64 and arm64 do not.
    assert "@other-gcc12.2.0-" in rebuilt(programs, GCC.replace("{", '{"architecture": "other", '))


def test_each_systems_own_software_keeps_them(programs: Path) -> None:
    found = software_of_systems(host_software(program=SIMULATION), ["orbslam2", "edgeslam"])
    assert {name: tag.partition("@")[2] for name, tag in found.items()} == {
        name: MACHINE[1:] for name in ("orbslam2", "edgeslam")
    }
    live = software_of_systems(image_software(), ["orbslam2", "edgeslam"])
    assert not any("@" in tag for tag in live.values()) and len(live) == 2


def test_a_live_run_is_measured_and_has_none(programs: Path) -> None:
    assert host_software() == image_software()
    assert not (programs / "asked").exists()


def test_the_program_is_asked_once(programs: Path) -> None:
    for _ in range(5):
        host_software(program=SIMULATION)
    assert (programs / "asked").read_text() == "asked\n"


def test_a_program_that_does_not_say_is_one_line(programs: Path) -> None:
    with pytest.raises(SlambedError, match="does not say what it was compiled for") as caught:
        rebuilt(programs, "slambed-sim 0.1.0")
    assert caught.value.code == ExitCode.ENVIRONMENT and "\n" not in str(caught.value)
