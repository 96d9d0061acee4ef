# SPDX-License-Identifier: Apache-2.0
"""Many concurrent virtual runs complete, even with slow commits and killed processes."""

import contextlib
import ctypes
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from multiprocessing import forkserver
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import psutil
import pytest
from harness_parts import needs_root, stand_in_sim, virtual_spec
from virtual_parts import Quiet
from waiting import LIMIT_S, in_background, until

from slambed.campaign import processes, server_folder
from slambed.campaign.executors import Executor
from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.processes import ProcessExecutor, Worker
from slambed.campaign.runner import MOST_DEATHS, Runner
from slambed.data.prepared import SEQUENCE_FILE
from slambed.engines.result import InterruptedRunError
from slambed.engines.virtual import NICE, go_behind
from slambed.errors import ExitCode, KilledError, PassingError, SlambedError
from slambed.metrics.summary import Summary
from slambed.spec.run_spec import RunSpec

AUTOGROUP = Path("/proc/self/autogroup")
PR_SET_DUMPABLE = 4


class SlowFolder(ResultFolder):
    """Simulates a slow disk."""

    def commit(self, run_key: str, raw: Path, replace: bool = False) -> None:
        time.sleep(random.uniform(0, 0.15))
        super().commit(run_key, raw, replace)


def runs(count: int, **changes: Any) -> list[RunSpec]:
    return [virtual_spec(seed=n, repetition=n, **changes) for n in range(count)]


MADE: list[ProcessExecutor] = []
"""Executors created by this test."""


@pytest.fixture(autouse=True)
def nothing_goes_on() -> Iterator[None]:
    """Ends the processes of a test, so that the next one does not see them as children."""
    yield
    while MADE:
        MADE.pop().close()


def runner(tmp_path: Path, jobs: int) -> Runner:
    (tmp_path / "sequence").mkdir()
    folder = SlowFolder(tmp_path / "tiny")
    folder.create()
    played = {"room": (tmp_path / "sequence", 0.5)}
    executor = ProcessExecutor(played, stand_in_sim(tmp_path), None, jobs)
    MADE.append(executor)
    return Runner(folder, Ledger(folder.path / "ledger.jsonl"), executor)


def children() -> list[psutil.Process]:
    """Returns every descendant process that executes a run: the simulation or its parent."""
    return psutil.Process().children(recursive=True)


def processes_of(executor: Executor) -> list[BaseProcess]:
    """Returns the executor's worker processes."""
    assert isinstance(executor, ProcessExecutor)
    return [worker._process for worker in executor._idle]


def simulations(tmp_path: Path) -> list[psutil.Process]:
    found = []
    for process in children():
        with contextlib.suppress(psutil.Error):  # it has ended in the meantime
            if str(tmp_path) in " ".join(process.cmdline()):
                found.append(process)
    return found


def test_many_jobs_with_slow_commits_complete(tmp_path: Path) -> None:
    """A pool of sixteen jobs used to hang when workers ended with the threads that had started
    them."""
    campaign = runner(tmp_path, 16)
    todo = runs(48)
    verdict = campaign.run(todo, Quiet())
    assert (verdict.done, verdict.valid, verdict.given_up) == (48, 48, {})
    assert campaign.folder.run_keys() == sorted(spec.run_key for spec in todo)
    assert {entry["event"] for entry in campaign.ledger.read()} == {"run_started", "run_finished"}
    assert simulations(tmp_path) == []


def test_a_run_says_under_which_plans_it_was_executed_whoever_reuses_it(tmp_path: Path) -> None:
    campaign = runner(tmp_path, 2)
    old, new = {"somebody": {"plan": "1234", "frozen": "ab"}}, {"somebody": {"plan": "5678"}}
    first, second = runs(2)
    campaign.plans = old
    campaign.run([first], Quiet())
    campaign.plans = new
    assert campaign.folder.state(first.run_key) == "valid"  # a campaign executes the other one
    campaign.run([second], Quiet())
    for spec, plans in ((first, old), (second, new)):
        manifest = campaign.folder.manifest(spec.run_key)
        assert manifest is not None
        assert {
            name: expected.as_json() for name, expected in (manifest.plans or {}).items()
        } == plans
        assert manifest.started_utc


def is_fork_server(process: psutil.Process) -> bool:
    """Also true for its forks, which keep the command line."""
    with contextlib.suppress(psutil.Error):
        return "multiprocessing.forkserver" in " ".join(process.cmdline())
    return False


def fork_server(tmp_path: Path) -> psutil.Process | None:
    """Returns the fork server whose child waits for a simulation; None otherwise."""
    for simulation in simulations(tmp_path):
        with contextlib.suppress(psutil.Error, ValueError):
            _, server, *_ = simulation.parents()
            if is_fork_server(server):
                return server
    return None


def test_a_killed_fork_server_costs_no_run(tmp_path: Path) -> None:
    """Nothing is forked from the harness, whose threads may hold locks at that moment."""
    campaign = runner(tmp_path, 3)
    killed: list[int] = []
    twice = tmp_path / "killed_twice"  # no run ends earlier, on any host

    def another() -> tuple[psutil.Process, list[psutil.Process]] | None:
        # A killed server may be visible for a while on a busy host.
        if (server := fork_server(tmp_path)) is None or server.pid in killed:
            return None
        with contextlib.suppress(psutil.NoSuchProcess):
            return server, server.children()
        return None

    def kill() -> None:
        try:
            for number in ("first", "second"):
                server, workers = until(another, f"the {number} fork server with a run")
                killed.append(server.pid)
                server.kill()
                # Its workers continue as children of init; only a new worker needs a new server.
                for worker in workers:
                    with contextlib.suppress(psutil.NoSuchProcess):
                        worker.kill()
        finally:
            twice.touch()

    todo = runs(9, params={"sim_until": str(twice)})
    with in_background(kill):
        verdict = campaign.run(todo, Quiet())
    assert len(set(killed)) == 2 and os.getpid() not in killed
    assert (verdict.done, verdict.valid, verdict.given_up) == (9, 9, {})
    assert campaign.folder.run_keys() == sorted(spec.run_key for spec in todo)
    finished = [e["run_key"] for e in campaign.ledger.read() if e["event"] == "run_finished"]
    assert sorted(finished) == campaign.folder.run_keys()
    assert simulations(tmp_path) == []


@dataclass
class Killer:
    """Kills processes of runs repeatedly, but fewer times than the limit of one run: on a busy
    host all kills may hit the last run."""

    tmp_path: Path
    every_s: float
    enough: Path  # created with the third kill: no run ends earlier
    over: threading.Event = field(default_factory=threading.Event)
    killed: int = 0

    def run(self) -> None:
        random.seed(1)
        while self.killed < MOST_DEATHS - 1 and not self.over.wait(self.every_s):
            try:
                simulation = random.choice(simulations(self.tmp_path))
                # The worker process that waits for the simulation.
                os.kill(simulation.ppid(), signal.SIGKILL)
                self.killed += 1
                if self.killed == 3:
                    self.enough.touch()
            except (IndexError, psutil.NoSuchProcess, ProcessLookupError):
                continue


def test_killed_processes_cost_no_run(tmp_path: Path) -> None:
    campaign = runner(tmp_path, 8)
    killer = Killer(tmp_path, every_s=0.5, enough=tmp_path / "killed_thrice")
    todo = runs(24, params={"sim_until": str(killer.enough), "sim_sleep_s": 0.3})
    with in_background(killer.run, killer.over):
        verdict = campaign.run(todo, Quiet())
    assert killer.killed >= 3
    assert (verdict.done, verdict.valid, verdict.given_up) == (24, 24, {})
    assert campaign.folder.run_keys() == sorted(spec.run_key for spec in todo)
    failed = [e for e in campaign.ledger.read() if e["event"] == "run_failed"]
    assert len(failed) <= killer.killed and all("was killed" in e["error"] for e in failed)
    assert simulations(tmp_path) == []


def test_virtual_runs_go_behind_what_is_live(tmp_path: Path) -> None:
    """Simulations and their workers must not slow down a live run on this host."""
    seen: list[tuple[int, int, str]] = []
    over = threading.Event()

    def look() -> None:
        while not over.wait(0.05):
            for process in simulations(tmp_path):
                with contextlib.suppress(psutil.Error, OSError, AttributeError):
                    group = Path(f"/proc/{process.pid}/autogroup")
                    shared = group.read_text().split()[-1] if group.exists() else str(NICE)
                    seen.append((process.nice(), process.parent().nice(), shared))

    with in_background(look, over):
        runner(tmp_path, 2).run(runs(2, params={"sim_sleep_s": 0.5}), Quiet())
    least = max(NICE, os.getpriority(os.PRIO_PROCESS, 0))
    assert seen and all(min(process, parent) >= least for process, parent, _ in seen)
    assert {shared for *_, shared in seen} == {str(NICE)}


@needs_root
@pytest.mark.skipif(not AUTOGROUP.exists(), reason="this kernel has no autogroups")
def test_those_of_somebody_who_is_not_root_do_as_well() -> None:
    """For other users than root the kernel allows one change per 0.1 s."""
    started = []
    for _ in range(3):
        pid = os.fork()
        if pid == 0:
            os.setsid()
            os.setuid(65534)
            ctypes.CDLL(None).prctl(PR_SET_DUMPABLE, 1, 0, 0, 0)  # else /proc files are root's
            go_behind()
            os._exit(0 if AUTOGROUP.read_text().split()[-1] == str(NICE) else 1)
        started.append(pid)
    assert [os.waitpid(pid, 0)[1] for pid in started] == [0, 0, 0]


KILLED_HARNESS = """
import sys
from pathlib import Path
import test_processes as tests
tests.runner(Path(sys.argv[1]), 2).run(tests.runs(2, params={"sim_sleep_s": 60}), tests.Quiet())
"""


def test_what_a_killed_harness_left_goes_with_the_next_campaign(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    """Its runs and their server end by themselves; the next campaign removes the server's
    socket."""
    # A socket address has at most 107 characters, too few for pytest's folders.
    scratch = Path(tempfile.mkdtemp(prefix="s"))
    request.addfinalizer(lambda: shutil.rmtree(scratch, ignore_errors=True))
    harness = psutil.Popen(
        [sys.executable, "-c", KILLED_HARNESS, str(tmp_path)],
        env={**os.environ, "TMPDIR": str(scratch), "PYTHONPATH": os.pathsep.join(sys.path)},
    )

    def both_run() -> bool:
        assert harness.poll() is None
        return len(simulations(tmp_path)) >= 3  # including the harness's own command line

    until(both_run, "two simulations of the harness")
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    started = harness.children(recursive=True)
    (folder,) = scratch.iterdir()
    server_folder.sweep()
    assert list(folder.rglob("listener-*")), "its owner lives"
    harness.kill()
    harness.wait(LIMIT_S)
    _, alive = psutil.wait_procs(started, LIMIT_S)
    assert alive == []
    server_folder.sweep()
    assert list(scratch.iterdir()) == []


def test_a_long_folder_of_temporary_files_is_no_obstacle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / ("long" * 25)))
    folder = server_folder.choose.__wrapped__()
    assert folder.is_dir() and len(str(folder)) < 70
    assert tempfile.tempdir == str(tmp_path / ("long" * 25))


def test_half_a_request_to_the_fork_server_is_no_traceback(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A killed harness leaves a server that reads an incomplete request."""
    ended = runner(tmp_path, 1).run(runs(1), Quiet())
    assert ended.done == 1
    server = next(filter(is_fork_server, psutil.Process().children()))
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(forkserver._forkserver._forkserver_address)
    # It stays a zombie until its owner needs a new one for the next run.
    until(lambda: server.status() == psutil.STATUS_ZOMBIE, "the end of the fork server")
    assert capfd.readouterr().err == ""


@dataclass
class Failing:
    """Fails these runs a number of times with this error."""

    error: Exception
    times: dict[int, int]
    jobs: int = 1
    left: dict[int, int] = field(default_factory=dict)

    def execute(
        self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1
    ) -> dict[str, Any]:
        if self.left.setdefault(spec.seed, self.times.get(spec.seed, 0)) > 0:
            self.left[spec.seed] -= 1
            raise self.error
        for name in ("manifest.json", "summary.json"):
            (raw / name).write_text('{"valid": true}')
        return Summary(valid=True, outcome="completed")

    def close(self) -> None: ...


def failing(tmp_path: Path, error: Exception, times: dict[int, int]) -> Runner:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    ledger = Ledger(folder.path / "ledger.jsonl")
    return Runner(folder, ledger, Failing(error, times), pauses_s=(0.01, 0.02))


def test_what_passes_costs_an_attempt(tmp_path: Path) -> None:
    campaign = failing(tmp_path, PassingError("the daemon restarts"), {0: 2, 1: 1})
    verdict = campaign.run(runs(3), Quiet())
    assert (verdict.done, verdict.given_up) == (3, {})


def test_a_run_that_goes_on_failing_is_given_up_and_the_others_go_on(tmp_path: Path) -> None:
    campaign = failing(tmp_path, PassingError("it never comes"), {1: 99})
    todo = runs(4)
    verdict = campaign.run(todo, Quiet())
    assert (verdict.done, verdict.given_up) == (3, {todo[1].run_key: "it never comes"})
    assert campaign.folder.state(todo[1].run_key) == "missing"


def test_what_no_run_survives_ends_the_campaign(tmp_path: Path) -> None:
    campaign = failing(tmp_path, SlambedError("no image", ExitCode.ENVIRONMENT), {0: 99})
    with pytest.raises(SlambedError, match="no image"):
        campaign.run(runs(4), Quiet())
    (tmp_path / "later").mkdir()
    later = failing(tmp_path / "later", OSError("gone"), dict.fromkeys(range(1, 20), 99))
    with pytest.raises(OSError, match="gone"):
        later.run(runs(20), Quiet())
    assert len(later.folder.run_keys()) == 1


def test_one_failing_run_does_not_end_a_campaign_that_goes_on(tmp_path: Path) -> None:
    todo = runs(4)
    campaign = failing(tmp_path, SlambedError("no such luck"), {todo[0].seed: 99})
    campaign.there = 3
    verdict = campaign.run(todo, Quiet())
    assert (verdict.done, verdict.given_up) == (3, {todo[0].run_key: "no such luck"})


def test_a_sequence_that_is_gone_makes_no_result(tmp_path: Path) -> None:
    campaign = failing(tmp_path, SlambedError("never"), {})
    campaign.sequences = {"room": tmp_path}
    with pytest.raises(SlambedError, match=r"sequence\.json is gone"):
        campaign.run(runs(1), Quiet())
    (tmp_path / SEQUENCE_FILE).write_text('{"checksum": "another"}')
    with pytest.raises(SlambedError, match=r"sequence\.json has changed"):
        campaign.run(runs(1), Quiet())
    (tmp_path / SEQUENCE_FILE).write_text('{"checksum": "abc"}')
    assert campaign.run(runs(1), Quiet()).done == 1


def test_a_process_that_is_killed_again_and_again_is_given_up(tmp_path: Path) -> None:
    campaign = failing(tmp_path, KilledError("was killed"), {1: 99})
    verdict = campaign.run(runs(3), Quiet())
    assert verdict.done == 2 and len(verdict.given_up) == 1


def test_a_process_takes_the_next_run_and_goes_with_the_campaign(tmp_path: Path) -> None:
    campaign = runner(tmp_path, 1)
    seen: set[int] = set()
    over = threading.Event()

    def look() -> None:
        while not over.wait(0.005):
            for simulation in simulations(tmp_path):
                with contextlib.suppress(psutil.Error):
                    seen.add(simulation.ppid())

    with in_background(look, over):
        assert campaign.run(runs(4, params={"sim_sleep_s": 0.1}), Quiet()).valid == 4
    (worker,) = seen - {os.getpid()}
    assert psutil.pid_exists(worker)
    campaign.executor.close()
    with contextlib.suppress(psutil.NoSuchProcess):
        assert psutil.Process(worker).wait(10) is not None


def test_one_that_is_killed_between_two_runs_costs_nothing(tmp_path: Path) -> None:
    campaign = runner(tmp_path, 1)
    first, second = runs(2)
    assert campaign.run([first], Quiet()).valid == 1
    # Only this executor's worker: one of another test may be about to end.
    (worker,) = processes_of(campaign.executor)
    worker.kill()
    worker.join(LIMIT_S)
    assert worker.exitcode is not None
    assert campaign.run([second], Quiet()).done == 2
    assert not [e for e in campaign.ledger.read() if e["event"] == "run_failed"]


def test_a_process_ends_after_so_many_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "MOST_RUNS", 2)
    begun: list[Worker] = []
    begin = Worker.__init__

    def note(worker: Worker) -> None:
        begun.append(worker)
        begin(worker)

    monkeypatch.setattr(Worker, "__init__", note)
    assert runner(tmp_path, 1).run(runs(5), Quiet()).valid == 5
    assert len(begun) == 3


def test_a_run_that_fails_leaves_its_process_to_the_next(tmp_path: Path) -> None:
    """The error includes the traceback of the worker."""
    executor = runner(tmp_path, 1).executor
    (spec,) = runs(1)
    never = threading.Event()
    with pytest.raises(FileNotFoundError) as error:
        executor.execute(spec, tmp_path / "no_folder", never)
    assert "in _write_files" in "".join(error.value.__notes__)
    (tmp_path / "raw").mkdir()
    before = processes_of(executor)
    assert executor.execute(spec, tmp_path / "raw", never).valid
    assert len(before) == 1 and processes_of(executor) == before


def test_a_signal_to_the_whole_process_group_is_an_interruption(tmp_path: Path) -> None:
    """It ends the worker before the campaign has handled it."""
    executor = runner(tmp_path, 1).executor
    (tmp_path / "raw").mkdir()
    (spec,) = runs(1, params={"sim_sleep_s": 60.0})
    stop = threading.Event()

    def strike() -> None:
        (simulation,) = until(lambda: simulations(tmp_path), "the simulation")
        psutil.Process(simulation.ppid()).terminate()
        stop.set()

    with in_background(strike), pytest.raises(InterruptedRunError):
        executor.execute(spec, tmp_path / "raw", stop)


def test_a_program_that_runs_an_experiment_does_not_start_again_in_each_process(
    tmp_path: Path,
) -> None:
    program = tmp_path / "sweep.py"
    program.write_text(
        "import threading\n"
        "from slambed.campaign.processes import Worker\n"
        "print('begun', flush=True)\n"
        "worker = Worker()\n"
        "print(type(worker.execute(None, threading.Event())).__name__)\n"
        "worker.kill()\n"
    )
    done = subprocess.run(
        [sys.executable, program], capture_output=True, text=True, timeout=60, check=False
    )
    # The worker answers with an error, because None is no task.
    assert done.stdout == "begun\nAttributeError\n", done.stderr


def test_a_worker_is_killed_with_its_simulation(tmp_path: Path) -> None:
    """Nothing writes into the folder of the run after that, so it can be removed."""
    executor = runner(tmp_path, 1).executor
    (tmp_path / "raw").mkdir()
    (spec,) = runs(1, params={"sim_sleep_s": 60.0})
    stop = threading.Event()
    seen: list[psutil.Process] = []

    def interrupt() -> None:
        seen.extend(until(lambda: simulations(tmp_path), "the simulation"))
        seen[0].suspend()  # It dies late, as on a busy host.
        stop.set()

    with in_background(interrupt), pytest.raises(InterruptedRunError):
        executor.execute(spec, tmp_path / "raw", stop)
    assert not seen[0].is_running() or seen[0].status() == psutil.STATUS_ZOMBIE
