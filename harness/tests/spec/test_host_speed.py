# SPDX-License-Identifier: Apache-2.0
"""The speed of the host, the limits of a board derived from it, and busy threads under these
limits."""

import json
from pathlib import Path

import pytest
from harness_parts import needs_root

from slambed.calibrate.host import HostMeasurement, measure_host
from slambed.calibrate.limits import engines, expected_cores, measure_limits, quiet_host
from slambed.commands.main import run_command
from slambed.engines.local import LocalEngine
from slambed.engines.sidecar_client import free_cpus, metronome_cpus
from slambed.errors import ExitCode, SlambedError
from slambed.native import find_program
from slambed.spec.device import Board, Device, Limits
from slambed.spec.host_speed import UNKNOWN, HostSpeed, load_host_speed, save_host_speed
from slambed.spec.library import Library


def pace_is_built() -> bool:
    try:
        find_program("slambed-pace")
    except SlambedError:
        return False
    return True


pytestmark = pytest.mark.live  # measurements need an otherwise idle machine
needs_pace = pytest.mark.skipif(not pace_is_built(), reason="needs slambed-pace ('make build')")


def board(count: int, speed: float, **limits: int) -> Device:
    return Device(
        name="x", title="x", limits=Limits(**limits), board=Board(cores=count, core_speed=speed)
    )


def test_a_board_gives_each_thread_a_core_of_its_own() -> None:
    limits = board(4, 0.25, memory_mb=512).limits_on(host_speed=1.0, host_cpus=2)
    assert (limits.cores, limits.quota_cores, limits.thread_cores) == (1, 1.0, 0.25)
    assert limits.memory_mb == 512
    # A host that is twice as fast needs half the quota.
    limits = board(4, 0.25).limits_on(host_speed=2.0, host_cpus=2)
    assert (limits.cores, limits.quota_cores, limits.thread_cores) == (1, 0.5, 0.125)
    limits = board(4, 0.5).limits_on(host_speed=1.0, host_cpus=8)
    assert (limits.cores, limits.quota_cores, limits.thread_cores) == (2, 2.0, 0.5)


def test_what_the_host_cannot_give_is_reported() -> None:
    small = board(4, 0.5, cores=1)
    limits = small.limits_on(1.0, 2)
    assert (limits.cores, limits.quota_cores, limits.thread_cores) == (1, 1.0, 0.5)
    assert small.shortfall(limits, 1.0) == "all its cores are 2.00, it gets 1.00"
    fast = board(1, 3.0)
    limits = fast.limits_on(1.0, 2)
    assert limits.thread_cores == 1.0
    assert "one of its cores is 3.00 of this host's" in (fast.shortfall(limits, 1.0) or "")
    assert board(2, 0.5).shortfall(board(2, 0.5).limits_on(1.0, 2), 1.0) is None


def test_a_run_means_the_board_not_the_host() -> None:
    meaning = board(4, 0.25).meaning("local")
    assert meaning["board"] == {"cores": 4, "core_speed": 0.25}
    assert board(4, 0.3).meaning("local") != meaning
    plain = Device(name="x", title="x", limits=Limits(quota_cores=0.3)).meaning("local")
    assert "board" not in plain and "thread_cores" not in plain["limits"]  # type: ignore[operator]


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"quota_cores": 0.3}, "follow from board"),
        ({"thread_cores": 0.3}, "follow from board"),
    ],
)
def test_limits_come_from_one_place(limits: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Device(name="x", title="x", limits=Limits(**limits), board=Board(cores=1, core_speed=1))


def test_a_thread_cannot_have_more_than_all() -> None:
    with pytest.raises(ValueError, match=r"thread_cores 0\.5 is more than quota_cores 0\.3"):
        Limits(quota_cores=0.3, thread_cores=0.5)


def test_a_speed_is_kept_for_this_host_alone(tmp_path: Path) -> None:
    assert load_host_speed(tmp_path) == UNKNOWN
    speed = HostSpeed(1.25, 0.03, "2026-01-01T00:00:00Z")
    path = save_host_speed(speed, tmp_path)
    assert load_host_speed(tmp_path) == speed
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"host": content["host"] | {"cpu": "another"}}))
    assert load_host_speed(tmp_path) == UNKNOWN
    path.write_text("{torn")
    assert load_host_speed(tmp_path) == UNKNOWN


def test_the_median_round_counts() -> None:
    speed = HostMeasurement([9000.0, 8100.0, 9900.0]).speed
    assert speed.speed == 1.0
    assert speed.spread == pytest.approx(0.2)


@needs_pace
def test_this_host_has_a_speed() -> None:
    assert measure_host(rounds=1, seconds=0.1).speed.speed > 0


def test_the_sampler_stays_away_from_the_nodes() -> None:
    assert free_cpus({"mobile": [0], "edge": [3]}, [0, 1, 2, 3]) == [1, 2]
    assert free_cpus({"mobile": [0], "edge": [1]}, [0, 1]) == [1]
    assert free_cpus({"mobile": [0]}, [0]) == [0]


def test_the_metronome_ticks_where_a_quota_is(monkeypatch: pytest.MonkeyPatch) -> None:
    limits = {"mobile": Limits(quota_cores=0.5), "edge": Limits(cores=1)}
    cpus = {"mobile": [0], "edge": [1]}
    monkeypatch.setattr("slambed.engines.sidecar_client.kernel_tick_s", lambda: 0.004)
    assert metronome_cpus(limits, cpus) == [0]  # type: ignore[arg-type]
    monkeypatch.setattr("slambed.engines.sidecar_client.kernel_tick_s", lambda: 0.001)
    assert metronome_cpus(limits, cpus) == []  # type: ignore[arg-type]


@needs_root
@needs_pace
def test_four_busy_threads_are_capped_one_by_one() -> None:
    device = board(4, 0.1, cores=1)
    with quiet_host():
        engine = LocalEngine(find_program("slambed-pace"))
        found = measure_limits(device, HostSpeed(1.0), engine, threads=4, seconds=1.0)
    # The caps were read back from the kernel for each thread.
    assert found.problems == []
    assert found.asked == 0.4
    # An upper limit; on a busy machine the use may be far below it.
    assert found.cpu < 0.4 * 1.1


def test_expected_cores() -> None:
    assert expected_cores(Limits(quota_cores=1.0, thread_cores=0.25), 1) == 0.25
    assert expected_cores(Limits(quota_cores=0.9, thread_cores=0.25), 4) == 0.9
    assert expected_cores(Limits(quota_cores=0.3), 4) == 0.3


def test_the_raspberry_pi_has_a_board() -> None:
    device = Library().device("raspberry_pi_4")
    assert device.board is not None and device.board.cores == 4
    assert device.limits_on(1.0, 2).thread_cores == device.board.core_speed


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["calibrate"], "give one of --host, --limits DEVICE"),
        (["calibrate", "--host", "--limits", "host"], "give one of"),
        (["calibrate", "--limits", "raspbery_pi_4"], "raspberry_pi_4"),
        (
            ["calibrate", "--limits", "raspberry_pi_4", "--engine", "virtual"],
            "known: docker, local",
        ),
        (["calibrate", "--match", "ijnc", "-o", "try.yaml"], "--output goes with --stages RUNS"),
        (["calibrate", "--match", "ijnc", "--cores", "2"], "--cores goes with --stages RUNS"),
        (["calibrate", "--stages", "x", "--jobs", "2"], "--jobs goes with --match FIT"),
        (["calibrate", "--host", "--seconds", "60"], "--seconds goes with --limits DEVICE"),
    ],
)
def test_bad_options_get_one_line(
    arguments: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(arguments) == 2
    reported = capsys.readouterr().err
    assert reported.startswith("error: ") and reported.count("\n") == 1 and line in reported


def test_limits_say_in_a_line_that_docker_does_not_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOCKER_HOST", "unix:///nowhere/docker.sock")
    with pytest.raises(SlambedError, match="no Docker: the daemon does not answer") as refused:
        engines("docker")
    assert refused.value.code == ExitCode.ENVIRONMENT
