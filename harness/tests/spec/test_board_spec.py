# SPDX-License-Identifier: Apache-2.0
"""`roles:` of an experiment: options allowed with a board, and the run key with a board."""

from pathlib import Path

import pytest
from command_line import slambed
from pydantic import ValidationError

from slambed.campaign.plan import check, notes
from slambed.errors import ExitCode, SlambedError
from slambed.link.named_profile import read_profile
from slambed.spec.board import Board, RoleHost
from slambed.spec.library import Library
from slambed.spec.matrix import Circumstances, expand, read_profiles
from slambed.spec.run_spec import RunSpec

EXPERIMENT = """\
id: walk
title: A walk with a board
systems: [{system: edgeslam, variant: static}]
datasets: [synthetic_room]
playback: {mode: realtime, fps: 10, end_s: 15}
link: {profiles: [none]}
roles: {mobile: {host: pi4}}
"""
PI4 = Board(name="pi4", architecture="aarch64", model="Raspberry Pi 4 Model B", cores=4)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "walk.yaml"
    path.write_text(EXPERIMENT)
    return path


def specs(file: Path, board: Board | None, *settings: str) -> list[RunSpec]:
    library = Library()
    experiment, source = library.experiment(str(file), list(settings))
    host = Circumstances(
        "docker", {"none": "network"}, "software", {"synthetic_room": ("room", "sum")}, board=board
    )
    profiles = read_profiles(experiment, source, read_profile)
    return expand(experiment, source, library, profiles, host, runs=1)


def test_a_run_on_a_board_is_another_run_than_one_here_and_than_one_on_another_board(
    file: Path,
) -> None:
    (there,) = specs(file, PI4)
    (here,) = specs(file, None, "roles=null")
    keys = {there.run_key, here.run_key}
    for change in ({"name": "pi5"}, {"architecture": "x86_64"}, {"model": "Other"}, {"cores": 2}):
        (other,) = specs(file, PI4.model_copy(update=change))
        keys.add(other.run_key)
    assert len(keys) == 6
    assert there.board == PI4 and here.board is None
    assert there.device_mobile.name == "pi4" and "aarch64" in there.device_mobile.hardware
    assert there.device_mobile.limits.quota_cores is None
    assert "board" not in here.meaning()


def test_the_same_board_under_another_address_is_the_same_run(file: Path) -> None:
    (first,) = specs(file, PI4)
    (later,) = specs(file, PI4, "roles.mobile.host=root@10.0.0.9", "roles.mobile.name=pi4")
    assert first.run_key == later.run_key
    assert RoleHost(host="root@10.0.0.9", name="pi4").called == "pi4"


def test_a_device_that_is_not_applied_is_reported(file: Path) -> None:
    experiment, _ = Library().experiment(str(file), ["devices.mobile=raspberry_pi_4"])
    (line,) = [line for line in notes(experiment, Library()) if "devices.mobile" in line]
    assert "raspberry_pi_4" in line and "pi4 is the device itself" in line
    experiment, _ = Library().experiment(str(file))
    assert not [line for line in notes(experiment, Library()) if "devices.mobile" in line]


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("link.profiles=[20]", "profile 'rtt_20' emulates a link, but to board pi4"),
        ("link.profiles=[none, ramp]", "profile 'ramp' emulates a link"),
        ("pace=device", "board pi4 has its own pace"),
        ("faults=[{at_s: 3, link: cut, for_s: 1}]", "nobody can cut the network to board pi4"),
        ("roles.mobile.host=-oProxyCommand=ls", "not '-oProxyCommand=ls'"),
        ("roles.mobile.over=carrier", "'roles.mobile.over': input should be 'ssh'"),
        ("roles.mobile.edge_address=pi4", "'pi4' is no IPv4 address"),
        ("roles.edge={host: pi4}", "unknown key 'edge'"),
        ("roles.mobile.name=a b", "expected a name of letters"),
    ],
)
def test_what_cannot_be_on_a_board_is_one_line(file: Path, setting: str, expected: str) -> None:
    code, _, err = slambed("run", str(file), "--check", "--set", setting)
    assert code == ExitCode.BAD_INPUT
    assert expected in err and f"--set {setting}" in err and err.count("\n") == 1, err


def test_neither_simulated_nor_on_several_hosts(file: Path, tmp_path: Path) -> None:
    code, _, err = slambed("run", str(file), "--check", "--engine", "virtual")
    assert code == ExitCode.BAD_INPUT and "runs live, not on engine virtual" in err
    hosts = tmp_path / "hosts.yaml"
    hosts.write_text("hosts: [{name: a, address: here, engine: local}]\n")
    code, _, err = slambed("run", str(file), "--hosts", str(hosts))
    assert code == ExitCode.BAD_INPUT and "has its edge here: no --hosts" in err, err
    assert slambed("run", str(file), "--check", "--hosts", str(hosts)) == (code, "", err)


def test_the_rtt_of_a_profile_is_none_of_a_real_network(file: Path) -> None:
    library = Library()
    settings = ["systems=[{system: dynnetslam, params: {rtt_source: profile}}]"]
    experiment, source = library.experiment(str(file), settings)
    with pytest.raises(SlambedError, match="rtt_source: profile asks for the RTT of an emulated"):
        check(experiment, source, library, "docker")


def test_a_program_of_its_own_stays_here(file: Path, tmp_path: Path) -> None:
    system = Path(__file__).parents[3] / "examples"
    library = Library()
    own = next(iter(sorted(system.rglob("system.yaml"))))
    experiment, source = library.experiment(
        str(file), [f"systems=[{{system: {own}}}]", "roles.mobile.host=pi4"]
    )
    with pytest.raises(SlambedError, match="a program of its own, which board pi4 cannot execute"):
        check(experiment, source, library, "docker")


def test_words_of_the_role_are_strict() -> None:
    with pytest.raises(ValidationError):
        RoleHost(host="pi4", engine="docker")  # type: ignore[call-arg]
