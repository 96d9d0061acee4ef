# SPDX-License-Identifier: Apache-2.0
"""Commands that end without Ctrl-C: a lost connection, a failed write, closed standard streams."""

import errno
import json
import os
import pty
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
from harness_parts import TOLERANCES, needs_root
from virtual_parts import make_sequence, needs_programs

from slambed.campaign.runner import stop_on_signal
from slambed.commands.main import main
from slambed.engines.host_lock import host_lock
from slambed.engines.reaper import reap
from slambed.engines.virtual import as_child
from slambed.errors import ExitCode
from slambed.failures import INTERRUPTED, REMEDIES, refused_write
from slambed.process.hangup import interrupt_once

SLAMBED = [sys.executable, "-c", "from slambed.commands.main import main; main()"]
LONG = """\
id: long
title: More runs than anybody waits for
systems: [{{system: orbslam2}}]
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
link: {{profiles: [none]}}
devices: {{mobile: host}}
runs: {{default: 500}}
tolerances: {tolerances}
"""


@pytest.fixture(scope="module")
def experiment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("long")
    sequence, tolerances = make_sequence(folder / "walk", 1), json.dumps(TOLERANCES)
    (folder / "long.yaml").write_text(LONG.format(sequence=sequence, tolerances=tolerances))
    return folder / "long.yaml"


def wait_until(come: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 120
    while not come():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def reaped_groups() -> list[Path]:
    """Removes and returns the cgroups that ended campaigns left."""
    with host_lock("tests of nodes", wait_s=120):
        return reap().groups


@needs_programs
@pytest.mark.parametrize("terminal", [True, False])
@pytest.mark.parametrize("engine", ["virtual", pytest.param("local", marks=needs_root)])
def test_a_lost_connection_keeps_finished_runs_and_leaves_nothing(
    experiment: Path, tmp_path: Path, engine: str, terminal: bool
) -> None:
    """With the terminal, a command's output is lost too; without one there is only the signal."""
    results = tmp_path / "results"
    command = [*SLAMBED, "run", str(experiment), "--engine", engine, "--no-figures"]
    command += ["--results", str(results)]
    if engine == "virtual":
        command += ["--jobs", "2"]
    else:
        command += ["--wait"]
        reaped_groups()
    child, ours = pty.fork()
    if child == 0:
        if not terminal:
            nowhere = os.open(os.devnull, os.O_RDWR)
            for number in range(3):
                os.dup2(nowhere, number)
        os.execv(command[0], command)
    begun: list[int] = []

    def is_playing() -> bool:
        begun[:] = [process.pid for process in psutil.Process(child).children(recursive=True)]
        return bool(begun) and any(results.glob("runs/*/summary.json"))

    wait_until(is_playing)
    if not terminal:
        os.kill(child, signal.SIGHUP)
    os.close(ours)
    ended: list[int] = []

    def has_ended() -> bool:
        pid, status = os.waitpid(child, os.WNOHANG)
        if pid:
            ended.append(os.waitstatus_to_exitcode(status))
        return bool(pid)

    wait_until(has_ended)
    assert ended == [INTERRUPTED]
    wait_until(lambda: not any(map(psutil.pid_exists, begun)))
    assert [path.name for path in (results / ".work").iterdir()] == [".lock"]
    whole = sorted(path.name for path in (results / "runs").iterdir())
    assert whole and all((results / "runs" / n / "manifest.json").is_file() for n in whole)
    assert '"interrupted": true' in (results / "long" / "ledger.jsonl").read_text()
    assert engine == "virtual" or reaped_groups() == []


def test_a_hangup_stops_a_campaign_and_nohup_keeps_it(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    before = signal.getsignal(signal.SIGHUP)
    with stop_on_signal() as stop:
        os.kill(os.getpid(), signal.SIGHUP)
        assert stop.wait(1)
    assert signal.getsignal(signal.SIGHUP) == before
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stop_on_signal() as stop:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not stop.wait(0.1)
        monkeypatch.setattr(sys, "argv", ["slambed", "--version"])
        with pytest.raises(SystemExit):
            main()
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_the_second_signal_of_one_lost_terminal_interrupts_no_cleanup() -> None:
    before = signal.signal(signal.SIGHUP, interrupt_once)
    try:
        with stop_on_signal() as stop:
            os.kill(os.getpid(), signal.SIGHUP)
            assert stop.wait(1)
        os.kill(os.getpid(), signal.SIGHUP)  # raises where the handler is restored
        signal.signal(signal.SIGHUP, interrupt_once)
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGHUP)
        os.kill(os.getpid(), signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def small_files() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))


@needs_programs
def test_a_limit_on_the_size_of_files_is_one_line(experiment: Path, tmp_path: Path) -> None:
    command = [
        *SLAMBED,
        "run",
        str(experiment),
        "--engine",
        "virtual",
        "--runs",
        "1",
        "--results",
        str(tmp_path),
        "--no-figures",
    ]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        preexec_fn=small_files,
    )
    lines = done.stderr.strip().splitlines()
    assert done.returncode == ExitCode.ENVIRONMENT and len(lines) == 1
    assert lines[0].startswith(f"error: {tmp_path}/long/experiment.json: File too large; raise")
    assert "ulimit -f" in lines[0] and not any(tmp_path.glob("runs/*"))


def test_a_limit_on_the_size_of_files_does_not_kill_the_simulation(tmp_path: Path) -> None:
    """Death by a signal would be recorded as a result of the system."""

    def start() -> None:
        small_files()
        as_child()

    with (tmp_path / "log").open("wb") as log:
        completed = subprocess.run(
            ["head", "-c", "5000", "/dev/zero"],
            stdout=log,
            stderr=subprocess.PIPE,
            check=False,
            preexec_fn=start,
        )
    assert completed.returncode == 1 and b"File too large" in completed.stderr


@pytest.mark.parametrize("number", REMEDIES)
def test_what_a_disk_refuses_names_the_file_and_a_remedy(tmp_path: Path, number: int) -> None:
    path = tmp_path / "table.csv"
    refused = OSError(number, os.strerror(number), str(path))
    reported = refused_write(refused)
    assert reported is not None and reported.code == ExitCode.ENVIRONMENT
    assert str(reported).startswith(f"{path}: {os.strerror(number)}; {REMEDIES[number]}")
    behind = ValueError("half a file")
    behind.__context__ = refused
    assert str(refused_write(behind)) == str(reported)


def test_a_file_that_was_open_is_named_too(tmp_path: Path) -> None:
    class Quota(type(tmp_path)):  # type: ignore[misc]
        def write_text(self, *_: object) -> int:
            raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT))

    with pytest.raises(OSError) as caught:
        Quota(tmp_path / "table.csv").write_text("1")
    assert str(refused_write(caught.value)).startswith(f"{tmp_path}/table.csv: ")


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams_are_like_dev_null(tmp_path: Path, closed: str) -> None:
    reported = tmp_path / "stdout.csv"
    truth = tmp_path / "truth.txt"
    truth.write_text("".join(f"{t} {t} {t % 2} 0 0 0 0 1\n" for t in range(9)))
    script = f'"$@" {closed} && exec "$@" >{reported}'
    command = ["bash", "-c", script, "bash", *SLAMBED, "evaluate", str(truth), str(truth)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == ExitCode.OK, done.stderr
    assert reported.read_text().startswith("ATE RMSE 0.000000 m")
    assert truth.read_text().count("\n") == 9


def test_an_error_is_no_bug_where_nobody_can_receive_it() -> None:
    done = subprocess.run(["bash", "-c", '"$@" 2>&-', "bash", *SLAMBED, "rnu"], check=False)
    assert done.returncode == ExitCode.BAD_INPUT
