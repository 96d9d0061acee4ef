# SPDX-License-Identifier: Apache-2.0
"""Virtual campaigns on Dask workers: the same results as on this host, even if a worker is
killed."""

import errno
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from threading import Event
from typing import Any
from unittest.mock import Mock

import pytest
from command_line import refused, slambed_process
from distributed import Client
from harness_parts import run_spec
from virtual_parts import fingerprints, make_sequence, needs_programs, write_experiment
from waiting import until

from slambed.campaign import cluster as cluster_module
from slambed.campaign.cluster import (
    ClusterExecutor,
    RemoteRun,
    execute_remotely,
    join_cluster,
    start_on_slurm,
)
from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.raw_folder import prepare_raw
from slambed.campaign.remote_result import LostWorkerError, result_of
from slambed.campaign.remote_sequence import pack, unpack
from slambed.engines.result import InterruptedRunError
from slambed.errors import ExitCode, PassingError, SlambedError
from slambed.failures import INTERRUPTED, refused_write
from slambed.native import find_program, repository_root
from slambed.spec.run_spec import RunSpec

RUNS = 3
CELLS = 2
STARTS_S = 120.0
"""Timeout for Dask's start, or a campaign's first run, on a busy host."""


@pytest.fixture(autouse=True)
def nobody_else_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "SETTLED_S", 0.0)


class Cluster:
    """A scheduler and workers in separate processes, as on separate machines."""

    def __init__(self, folder: Path, **environment: str) -> None:
        self.folder = folder
        self.environment = os.environ | environment
        self.file = folder / "scheduler.json"
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._start("scheduler", "scheduler", "--host", "127.0.0.1", "--port", "0")
        # The scheduler writes the file in place, so it may exist before its content.
        until(
            lambda: self.file.is_file() and self.file.read_text().rstrip().endswith("}"),
            "the scheduler's address",
            STARTS_S,
        )
        self.address = str(json.loads(self.file.read_text())["address"])

    def add_worker(self, name: str) -> None:
        scratch = self.folder / name
        # Without a nanny a killed worker is not restarted.
        self._start(
            name,
            "worker",
            "--name",
            name,
            "--nthreads",
            "1",
            "--no-nanny",
            "--local-directory",
            str(scratch),
        )

    def _start(self, name: str, *arguments: str) -> None:
        log = (self.folder / f"{name}.log").open("wb")
        command = [sys.executable, "-m", "dask", *arguments, "--no-dashboard"]
        self.processes[name] = subprocess.Popen(
            [*command, "--scheduler-file", str(self.file)],
            stdout=log,
            stderr=subprocess.STDOUT,
            env=self.environment,
        )
        log.close()

    def close(self) -> None:
        for process in self.processes.values():
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    (tmp_path / "cluster").mkdir()
    found = Cluster(tmp_path / "cluster")
    yield found
    found.close()


@needs_programs
@pytest.mark.timeout(900)  # Dask starts, and two campaigns: 106 s at a load of 11.
@pytest.mark.nightly
def test_a_killed_worker_costs_no_run_and_makes_none_twice(
    tmp_path: Path, cluster: Cluster
) -> None:
    path = write_experiment(tmp_path, make_sequence(tmp_path / "walk"), RUNS)
    here = ResultFolder(tmp_path / "here" / "walk")
    code, out, err = slambed_process(
        "run", str(path), "--results", str(here.path.parent), "--no-figures"
    )
    assert code == ExitCode.OK, out + err

    for name in ("a", "b"):
        cluster.add_worker(name)
    there = ResultFolder(tmp_path / "there" / "walk")
    command = ["run", str(path), "--no-figures", "--results", str(there.path.parent)]
    command += ["--scheduler", cluster.address]
    with Client(cluster.address) as client:
        client.wait_for_workers(2, timeout=STARTS_S)
        addresses = {info["name"]: a for a, info in client.scheduler_info()["workers"].items()}
        campaign = subprocess.Popen(
            [sys.executable, "-c", "from slambed.commands.main import main; main()", *command],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        ledger = Ledger(there.path / "ledger.jsonl")
        # Mid-campaign: one run has ended, and the worker executes another.
        until(lambda: "run_finished" in events(ledger), "the end of a run", STARTS_S)
        until(
            lambda: client.processing().get(addresses["a"]) and in_hand(cluster, "a"),
            "a run on worker a",
        )
        os.kill(cluster.processes["a"].pid, signal.SIGKILL)
        out, _ = campaign.communicate(timeout=300)
        assert campaign.returncode == ExitCode.OK, out
        assert list(client.scheduler_info()["workers"]) == [addresses["b"]]

    assert fingerprints(there) == fingerprints(here)
    assert len(there.run_keys()) == RUNS * CELLS
    entries = ledger.read()
    for kind in ("run_started", "run_finished"):
        keys = [entry["run_key"] for entry in entries if entry["event"] == kind]
        assert sorted(keys) == there.run_keys()
    assert Counter(events(ledger))["run_interrupted"] == 0

    # A repeated call, on the cluster or locally, has nothing to do.
    for again in (command, command[:-2]):
        code, out, err = slambed_process(*again)
        assert code == ExitCode.OK and f"{RUNS * CELLS} there already" in out, err


def test_a_worker_gets_the_path_that_a_run_is_compared_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has no file of the campaign's machine."""
    monkeypatch.setattr("distributed.get_worker", lambda: Mock(local_directory=str(tmp_path)))
    monkeypatch.setattr(cluster_module, "remote_sequence", lambda spec, there: there)
    monkeypatch.setattr(cluster_module, "_program", lambda software, system: Path("slambed-sim"))
    seen: list[bytes] = []

    def task(spec: RunSpec, *_: object) -> Mock:
        seen.append(Path(spec.reference).read_bytes())
        return Mock()

    monkeypatch.setattr(cluster_module, "VirtualTask", task)
    spec = run_spec().model_copy(update={"reference": "/not/here/trajectory.txt"})
    execute_remotely(RemoteRun(spec, tmp_path, 1.0, [], 1, b"0 1 2 3 0 0 0 1\n"))
    assert seen == [b"0 1 2 3 0 0 0 1\n"]


def test_workers_that_start_one_after_another_are_all_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "SETTLED_S", 0.02)
    client, told = Mock(), []
    counts = iter([{"a": 1}, {"a": 1, "b": 1}, {"a": 1, "b": 1, "c": 4}])
    last = {"a": 1, "b": 1, "c": 4}
    client.nthreads.side_effect = lambda: next(counts, last)
    monkeypatch.setattr("distributed.Client", lambda *_, **__: client)
    assert join_cluster({}, "tcp://lab:8786", None, told.append).jobs == 6
    assert told[0].startswith("6 runs at a time") and "later, give --jobs" in told[0]
    assert join_cluster({}, "tcp://lab:8786", 2, told.append).jobs == 2 and len(told) == 1


def test_a_full_disk_of_a_worker_is_not_the_campaigns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It costs attempts of a run, and the line names the machine."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "/scratch/raw")

    monkeypatch.setattr("distributed.get_worker", lambda: Mock(local_directory=str(tmp_path)))
    monkeypatch.setattr(cluster_module, "remote_sequence", full)
    with pytest.raises(PassingError, match=r"^worker on \S+: no space .*/scratch/raw") as raised:
        execute_remotely(RemoteRun(run_spec(), tmp_path, 1.0, [], 1))
    future = Mock(status="error")
    future.result.side_effect = raised.value
    assert isinstance(refused_write(raised.value), SlambedError)
    with pytest.raises(PassingError) as here:
        result_of(future, Event())
    assert refused_write(here.value) is None


def test_a_path_to_compare_with_that_is_gone_is_one_line(tmp_path: Path) -> None:
    spec = run_spec().model_copy(update={"reference": str(tmp_path / "gone.txt")})
    executor = ClusterExecutor({spec.dataset: (tmp_path, 1.0)}, Mock(), 1)
    for begin in (
        lambda: executor.execute(spec, tmp_path, Event()),
        lambda: prepare_raw(spec, tmp_path),
    ):
        with pytest.raises(SlambedError, match=r"gone.txt.* is gone; start the campaign again"):
            begin()


def events(ledger: Ledger) -> list[str]:
    return [str(entry["event"]) for entry in ledger.read()]


def in_hand(cluster: Cluster, name: str) -> bool:
    """The worker's simulation has begun to write."""
    return any((cluster.folder / name).rglob("events.jsonl"))


def test_what_a_worker_returns_is_waited_for_until_nobody_can_return_it(tmp_path: Path) -> None:
    cluster, stop = Cluster(tmp_path, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="0"), Event()
    try:
        for name in ("a", "b"):
            cluster.add_worker(name)
        with Client(cluster.address) as client:
            client.wait_for_workers(2, timeout=120)
            assert result_of(client.submit(abs, -3), stop) == 3
            with pytest.raises(FileNotFoundError, match="/nowhere"):  # the task's own error
                result_of(client.submit(os.listdir, "/nowhere"), stop)
            with pytest.raises(LostWorkerError) as lost:
                result_of(client.submit(os._exit, 1), stop)
            assert lost.value.killed

            def sleeping() -> Any:
                return client.submit(time.sleep, 60, pure=False)

            with pytest.raises(LostWorkerError) as lost:
                result_of(given_up := sleeping(), stop, lambda: False)
            assert not lost.value.killed and given_up.cancelled()
            threading.Timer(0.3, stop.set).start()
            with pytest.raises(InterruptedRunError):
                result_of(given_up := sleeping(), stop)
            assert given_up.cancelled()
            threading.Timer(0.3, cluster.processes["scheduler"].kill).start()
            with pytest.raises(LostWorkerError) as lost:
                result_of(sleeping(), Event())
            assert not lost.value.killed
    finally:
        cluster.close()


def test_a_timeout_of_the_run_itself_is_an_error_and_no_reason_to_wait() -> None:
    future = Mock(status="error")
    future.result.side_effect = TimeoutError("disk of the worker")
    with pytest.raises(TimeoutError, match="disk of the worker"):
        result_of(future, Event())
    late = Mock(status="finished")
    late.result.side_effect = [TimeoutError(), 3]
    assert result_of(late, Event()) == 3


@needs_programs
def test_a_worker_with_other_sources_is_refused(tmp_path: Path, cluster: Cluster) -> None:
    cluster.add_worker("a")
    path = write_experiment(tmp_path, make_sequence(tmp_path / "walk", 1), 1)
    other = tmp_path / "bin"
    other.mkdir()
    program = other / "slambed-sim"
    # Trailing bytes change the hash of a program but not its behavior.
    program.write_bytes(find_program("slambed-sim").read_bytes() + b"other")
    program.chmod(0o755)
    line = refused(
        ExitCode.ENVIRONMENT,
        "run",
        str(path),
        "--results",
        str(tmp_path / "results"),
        "--scheduler",
        cluster.address,
        SLAMBED_BIN=str(other),
    )
    assert "worker on" in line and "software is" in line
    assert not ResultFolder(tmp_path / "results" / "walk").run_keys()


def test_what_cannot_be_is_refused(tmp_path: Path) -> None:
    live = ("run", "quickstart", "--engine", "local")
    for option in (("--scheduler", "tcp://127.0.0.1:1"), ("--slurm",)):
        assert "for virtual runs" in refused(ExitCode.BAD_INPUT, *live, *option)
    for check in ((), ("--check",)):
        line = refused(ExitCode.BAD_INPUT, *live, "--jobs", "2", *check)
        assert "--jobs is for virtual runs, a live run takes a whole host" in line
    both = ("run", "quickstart", "--slurm", "--scheduler", "tcp://127.0.0.1:1")
    assert "one of" in refused(ExitCode.BAD_INPUT, *both)


@needs_programs
def test_a_scheduler_that_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slambed.campaign.cluster.CONNECT_TIMEOUT_S", 1.0)
    path = write_experiment(tmp_path, make_sequence(tmp_path / "walk", 1), 1)
    arguments = ("run", str(path), "--results", str(tmp_path / "results"))
    line = refused(ExitCode.ENVIRONMENT, *arguments, "--scheduler", "tcp://127.0.0.1:1")
    assert "no Dask scheduler at tcp://127.0.0.1:1" in line
    assert "--jobs" in refused(ExitCode.BAD_INPUT, *arguments, "--slurm")


SBATCH = """#!/bin/bash
# Stands for Slurm: takes the job script, then runs it on this host.
cp "${@: -1}" "$0.job"
bash "$0.job" >"$0.log" 2>&1 &
echo "Submitted batch job $!"
"""


@needs_programs
def test_slurm_jobs_become_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the path of Python has a blank."""
    (tmp_path / "my environment").symlink_to(Path(sys.executable).parent.parent)
    program = tmp_path / "my environment" / "bin" / Path(sys.executable).name
    monkeypatch.setattr(sys, "executable", str(program))
    (tmp_path / "bin").mkdir()
    for name, text in (("sbatch", SBATCH), ("scancel", '#!/bin/bash\nkill "$@"\n')):
        (tmp_path / "bin" / name).write_text(text)
        (tmp_path / "bin" / name).chmod(0o755)
    path = write_experiment(tmp_path, make_sequence(tmp_path / "walk", 1), 1)
    arguments = ("run", str(path), "--results", str(tmp_path / "results"), "--no-figures")
    arguments = (*arguments, "--slurm", "--jobs", "1")
    found = f"{tmp_path / 'bin'}:{os.environ['PATH']}"
    here = str(repository_root() / "harness")
    code, out, err = slambed_process(*arguments, cwd=tmp_path, PATH=found, PYTHONPATH=here)
    assert code == ExitCode.OK, out + err
    assert len(ResultFolder(tmp_path / "results" / "walk").run_keys()) == CELLS
    assert "tcp://" in (tmp_path / "bin" / "sbatch.log").read_text()


def test_who_waits_for_slurm_is_told_where_to_look(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A job that never becomes a worker is cancelled when the campaign ends."""
    for name, text in (
        ("sbatch", '#!/bin/bash\necho "Submitted batch job 17"\n'),
        ("scancel", f'#!/bin/bash\necho "$@" >>"{tmp_path}/cancelled"\n'),
    ):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("slambed.campaign.cluster.FIRST_NOTE_S", 0.1)
    notes = []

    def note(line: str) -> None:
        notes.append(line)
        if len(notes) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        start_on_slurm({}, 1, note)
    assert "squeue --me" in notes[0] and str(tmp_path) in notes[0]
    assert (tmp_path / "cancelled").read_text().split() == ["17"]


@needs_programs
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_while_slurm_lets_wait_cancels_the_job(
    tmp_path: Path, how: signal.Signals
) -> None:
    (tmp_path / "bin").mkdir()
    for name, text in (
        ("sbatch", 'echo "Submitted batch job 17"'),
        ("scancel", f'echo "$@" >>"{tmp_path}/cancelled"'),
    ):
        (tmp_path / "bin" / name).write_text(f"#!/bin/bash\n{text}\n")
        (tmp_path / "bin" / name).chmod(0o755)
    path = write_experiment(tmp_path, make_sequence(tmp_path / "walk", 1), 1)
    command = ["run", str(path), "--results", str(tmp_path / "results"), "--slurm", "--jobs", "1"]
    with subprocess.Popen(
        [
            sys.executable,
            "-c",
            "import logging\n"
            "logging.basicConfig()\n"
            "logging.getLogger('dask_jobqueue').setLevel(logging.DEBUG)\n"
            "from slambed.commands.main import main; main()",
            *command,
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=tmp_path,
        env=os.environ
        | {
            "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}",
            "PYTHONPATH": str(repository_root() / "harness"),
        },
    ) as campaign:
        # Dask logs the number of the job after it was read.
        assert campaign.stdout is not None
        printed = [""]
        try:
            while "Starting job: 17" not in printed[-1]:
                printed.append(campaign.stdout.readline())
                assert printed[-1], "".join(printed)
            campaign.send_signal(how)
            out, _ = campaign.communicate(timeout=STARTS_S)
        finally:
            campaign.kill()
    out = "".join([*printed, out])
    assert campaign.returncode == INTERRUPTED, out
    assert "interrupted" in out and "Traceback" not in out, out
    assert (tmp_path / "cancelled").read_text().split() == ["17"]


@needs_programs
def test_a_scheduler_without_workers(
    tmp_path: Path, cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slambed.campaign.cluster.FIRST_WORKER_TIMEOUT_S", 1.0)
    path = write_experiment(tmp_path, make_sequence(tmp_path / "walk", 1), 1)
    arguments = ("run", str(path), "--results", str(tmp_path / "results"))
    line = refused(ExitCode.ENVIRONMENT, *arguments, "--scheduler", cluster.address)
    assert f"no worker in 1 s; start one on each machine: dask worker {cluster.address}" in line


def test_a_run_travels_without_its_raw_logs(tmp_path: Path) -> None:
    away, home = tmp_path / "away", tmp_path / "home"
    (away / "mobile").mkdir(parents=True)
    home.mkdir()
    (away / "summary.json").write_text("{}")
    (away / "mobile" / "trajectory.txt").write_text("0 0 0 0 0 0 0 1\n")
    (away / "mobile" / "events.jsonl").write_text("{}\n")
    # What a program may leave besides: unpacking a link to anywhere would be refused.
    (away / "mobile" / "anywhere").symlink_to("/etc/passwd")
    (away / "mobile" / "map.slm").symlink_to("/etc/passwd")
    (away / "mobile" / "log.txt").symlink_to(away)
    (away / "mobile" / "cache.bin").write_text("large")
    unpack(pack(away), home)
    found = sorted(p.relative_to(home).as_posix() for p in home.rglob("*") if p.is_file())
    assert found == ["mobile/trajectory.txt", "summary.json"]
