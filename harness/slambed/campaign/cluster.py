# SPDX-License-Identifier: Apache-2.0
"""Virtual runs on the workers of a Dask cluster: `--scheduler tcp://...` and `--slurm`.

A run is executed in a scratch folder of its worker and returned as an archive. Workers therefore
need the same sources and the sequence, but no common file system. Only this process writes results
and ledger: a worker that dies leaves nothing, and Dask reassigns its run.
"""

import math
import signal
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from shlex import quote
from typing import Any

from slambed.campaign.executors import Played
from slambed.campaign.progress import duration
from slambed.campaign.raw_folder import reference_of
from slambed.campaign.remote_result import LostWorkerError, of_machine, result_of
from slambed.campaign.remote_sequence import pack, remote_sequence, unpack, with_reference
from slambed.campaign.virtual_task import VirtualTask
from slambed.data.places import cache_folder
from slambed.errors import KilledError, environment_error
from slambed.metrics.summary import Summary
from slambed.native import SIMULATION, find_program, how_to_build
from slambed.spec.run_spec import RunSpec
from slambed.spec.software import host_software, software_of_systems

CONNECT_TIMEOUT_S = 20.0
FIRST_WORKER_TIMEOUT_S = 600.0
"""Of a scheduler. Slurm may queue its first job for hours, so nothing limits that wait."""
FIRST_NOTE_S = 60.0
"""Without a worker for so long, a note says so; the wait for each further note is twice as long."""
SETTLED_S, COUNT_EVERY_S = 3.0, 0.2
"""If no worker came for so long, all that were started are there."""
SLURM_MEMORY = "2 GiB"
"""Memory of one worker, unless Dask's configuration sets it."""


@dataclass
class ClusterExecutor:
    """Executes virtual runs on the scheduler's workers."""

    played: Played
    client: Any
    jobs: int

    def execute(self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1) -> Summary:
        """Submits the run to the cluster and waits for it."""
        sequence, played_s = self.played[spec.dataset]
        away = RemoteRun(spec, sequence.resolve(), played_s, sys.argv, attempt, reference_of(spec))
        try:
            found: tuple[Summary, bytes] = result_of(
                self.client.submit(execute_remotely, away, pure=False), stop
            )
        except LostWorkerError as lost:
            if lost.killed:
                message = (
                    f"workers died again and again in run {spec.run_key}; is there enough memory?"
                )
                raise KilledError(message) from None
            raise environment_error(
                "the scheduler is gone; finished runs are kept, start it and call again to go on"
            ) from None
        summary, files = found
        unpack(files, raw)
        return summary

    def close(self) -> None:
        """Disconnects; a cluster started for this campaign ends."""
        _close(self.client)


def join_cluster(
    played: Played, address: str, jobs: int | None, notify: Callable[[str], None]
) -> ClusterExecutor:
    """Connects to an existing scheduler and its workers."""
    distributed = imported("distributed", "--scheduler")
    try:
        client = distributed.Client(address, timeout=CONNECT_TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise environment_error(
            f"no Dask scheduler at {address}: {error}; start one: dask scheduler"
        ) from None
    hint = f"start one on each machine: dask worker {address}"
    return _pool(played, client, jobs, notify, hint, FIRST_WORKER_TIMEOUT_S)


def start_on_slurm(played: Played, jobs: int, notify: Callable[[str], None]) -> ClusterExecutor:
    """Starts workers as Slurm jobs with one core each; queue, account and wall time come from
    Dask's configuration (jobqueue.yaml)."""
    with _own_ctrl_c():
        jobqueue = imported("dask_jobqueue", "--slurm")
    distributed = imported("distributed", "--slurm")
    config = imported("dask.config", "--slurm")
    cluster = client = None
    try:
        with _ctrl_c_later():
            cluster = jobqueue.SLURMCluster(
                cores=config.get("jobqueue.slurm.cores", None) or 1,
                memory=config.get("jobqueue.slurm.memory", None) or SLURM_MEMORY,
                # A word of the job's script, so a path with a blank needs quotes.
                python=config.get("jobqueue.slurm.python", None) or quote(sys.executable),
            )
            cluster.scale(jobs=jobs)
            client = distributed.Client(cluster)
    except BaseException as error:
        if client is not None:
            _close(client)
        elif cluster is not None:
            cluster.close()
        if isinstance(error, OSError | RuntimeError | ValueError):
            raise environment_error(f"Slurm refuses: {error}") from None
        raise
    logs = Path(config.get("jobqueue.slurm.log-directory", None) or "").resolve()
    hint = f"'squeue --me' lists the jobs that wait; those that ended leave a log in {logs}"
    return _pool(played, client, jobs, notify, hint, math.inf)


def _pool(
    played: Played,
    client: Any,
    jobs: int | None,
    notify: Callable[[str], None],
    hint: str,
    longest_s: float,
) -> ClusterExecutor:
    """Waits for the first worker. `hint`: what to do where none comes."""
    try:
        waited_s, next_s = 0.0, FIRST_NOTE_S
        while not _has_worker(client, wait_s := min(next_s, longest_s - waited_s)):
            waited_s += wait_s
            next_s *= 2
            line = f"no worker in {duration(waited_s)}; {hint}"
            if waited_s >= longest_s:
                raise environment_error(line)
            notify(line)
        if jobs is None:
            jobs = _settled_threads(client)
            notify(
                f"{jobs} runs at a time, as many as the workers have threads; for workers that "
                "come later, give --jobs"
            )
        return ClusterExecutor(played, client, jobs)
    except BaseException:
        # Slurm's jobs would go on without a campaign.
        _close(client)
        raise


@contextmanager
def _own_ctrl_c() -> Iterator[None]:
    """Keeps this process's handler of SIGINT: importing dask_jobqueue sets one that exits with
    status 0, as if a campaign that Ctrl-C ended were complete."""
    kept = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, kept)


@contextmanager
def _ctrl_c_later() -> Iterator[None]:
    """Delivers Ctrl-C, SIGHUP and SIGTERM after the block: Dask cannot cancel jobs whose submission
    they interrupt.

    The mask keeps them from threads and programs that the block starts. Other threads of this
    process may still get them, so the handlers wait, too.
    """
    came: list[int] = []
    known = {
        number: signal.getsignal(number)
        for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM)
    }
    kept = {n: how for n, how in known.items() if how not in (None, signal.SIG_IGN)}
    for number in kept:
        signal.signal(number, lambda received, _: came.append(received))
    signal.pthread_sigmask(signal.SIG_BLOCK, kept)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, kept)
        for number, handler in kept.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


def _close(client: Any) -> None:
    cluster = client.cluster
    client.close()
    if cluster is not None:
        cluster.close()


def _settled_threads(client: Any) -> int:
    """Returns the number of threads of all workers, which start one after another, once it no
    longer grows."""
    most, since_s = 0, time.monotonic()
    while True:
        found: int = sum(client.nthreads().values())
        if found > most:
            most, since_s = found, time.monotonic()
        elif time.monotonic() - since_s >= SETTLED_S:
            return max(found, 1)
        time.sleep(min(SETTLED_S, COUNT_EVERY_S))


def _has_worker(client: Any, wait_s: float) -> bool:
    try:
        client.wait_for_workers(1, timeout=wait_s)
    except TimeoutError:
        return False
    return True


def imported(module: str, option: str) -> Any:
    """Imports an optional module for distributed campaigns. Raises SlambedError if it is
    missing."""
    import importlib

    try:
        return importlib.import_module(module)
    except ImportError:
        raise environment_error(
            f"{option} needs {module.partition('.')[0]}; pip install 'slambed[cluster]'"
        ) from None


@dataclass(frozen=True)
class RemoteRun:
    """A run as it is sent to a worker, which finds everything else locally."""

    spec: RunSpec
    sequence: Path
    """Path of the sequence on the campaign's machine."""
    played_s: float
    command: list[str]
    attempt: int
    reference: bytes | None = None
    """Content of the path that the run is compared with."""


def execute_remotely(away: RemoteRun) -> tuple[Summary, bytes]:
    """Executes the run on a worker; returns its summary and its packed folder."""
    from distributed import get_worker

    # Uses the worker's own folder: Dask removes what a killed worker leaves there.
    place = get_worker().local_directory
    with (
        of_machine(f"worker on {socket.gethostname()}"),
        tempfile.TemporaryDirectory(dir=place) as scratch,
    ):
        raw = Path(scratch) / "raw"
        raw.mkdir()
        spec = with_reference(away.spec, away.reference, Path(scratch))
        task = VirtualTask(
            spec,
            raw,
            remote_sequence(spec, away.sequence),
            away.played_s,
            _program(spec.software, spec.system),
            cache_folder() / "features",
            away.command,
            away.attempt,
        )
        return task.execute(), pack(raw)


@cache
def _program(software: str, system: str) -> Path:
    whole = host_software(program=SIMULATION)
    if (found := software_of_systems(whole, [system]).get(system, whole)) != software:
        message = f"software is {found}, the campaign's {software}; run {how_to_build()}"
        raise environment_error(message)
    return find_program(SIMULATION)
