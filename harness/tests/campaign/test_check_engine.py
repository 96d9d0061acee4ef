# SPDX-License-Identifier: Apache-2.0
"""`slambed run --check` reports the same about the engine as `slambed run`."""

from pathlib import Path

import pytest
from command_line import slambed
from harness_parts import needs_root
from test_foreign import MINE, write_system
from virtual_parts import needs_programs

from slambed.errors import ExitCode

NO_DOCKER = {"DOCKER_HOST": "unix:///nowhere/docker.sock"}


@needs_root
def test_without_docker_auto_says_that_it_takes_local() -> None:
    code, out, err = slambed("run", "quickstart", "--check", **NO_DOCKER)
    assert code == ExitCode.OK, err
    assert out.splitlines()[0].endswith("quickstart.yaml: good")
    assert "engine: local (no Docker: the daemon does not answer" in out


@needs_root
@pytest.mark.parametrize("where", ["option", "file"])
def test_without_docker_the_engine_docker_is_refused_as_by_run(tmp_path: Path, where: str) -> None:
    path = tmp_path / "one.yaml"
    text = "id: one\ntitle: one\nsystems: [{system: orbslam2}]\ndatasets: [synthetic_room]\n"
    path.write_text(text + ("engine: docker\n" if where == "file" else ""))
    asked = ["run", str(path), *(["--engine", "docker"] if where == "option" else [])]
    code, out, refusal = slambed(*asked, "--check", **NO_DOCKER)
    assert code == ExitCode.ENVIRONMENT and "engine:" not in out, out
    assert "no Docker: the daemon does not answer" in refusal and refusal.count("\n") == 1
    more = ["--results", str(tmp_path / "results")]
    assert slambed(*asked, *more, **NO_DOCKER) == (ExitCode.ENVIRONMENT, "", refusal)
    assert not (tmp_path / "results").exists()


def test_without_permission_it_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slambed.campaign.choose.is_root", lambda: False)
    code, _, err = slambed("run", "quickstart", "--check", **NO_DOCKER)
    assert code == ExitCode.ENVIRONMENT and "no permission for a live run: not root" in err


def test_programs_that_are_not_built_are_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slambed.native.build_folder", lambda: tmp_path)
    code, out, err = slambed("run", "quickstart", "--check", "--engine", "virtual", SLAMBED_BIN="")
    assert code == ExitCode.OK, err
    assert "engine: virtual" in out and "would be refused: slambed-sim is not built" in out


@needs_root
@needs_programs
def test_a_program_of_ones_own_that_is_not_there_is_reported(tmp_path: Path) -> None:
    write_system(tmp_path / "mine", MINE + "  files: [weights.bin]\n")
    path = tmp_path / "one.yaml"
    path.write_text(
        "id: one\ntitle: one\nsystems: [{system: ./mine/system.yaml}]\ndatasets: [synthetic_room]\n"
    )
    code, out, err = slambed("run", str(path), "--check", "--engine", "local")
    assert code == ExitCode.OK and "would be refused: runtime of " in out, err
    assert "weights.bin: No such file" in out
